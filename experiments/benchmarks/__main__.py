"""Our solvers and others' on families of problems: docs/benchmarks.csv and .md, tables of README.md and paper.md."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from assoc._files.output import write_text

if TYPE_CHECKING:
    from experiments.benchmarks.families import Case
    from experiments.benchmarks.rows import Row

# One thread for numerical libraries, before they are loaded: our solvers are measured on one.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

TABLE, PAGES = Path("docs/benchmarks.csv"), (Path("README.md"), Path("paper.md"))
# what a brief run gives other solvers, in seconds
_BRIEF_LIMIT = 5.0
FAMILIES = (
    "paper", "gated", "ghost", "wide gap", "wide gates", "known optimum", "random axial", "planted", "kbest",
)  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.benchmarks",
        description="Run our solvers and other people's on the benchmark families; write the rows, the report "
        f"and, for {TABLE}, the tables of README.md and paper.md.",
    )
    parser.add_argument("--families", nargs="+", metavar="NAME", help=f"only these: {', '.join(FAMILIES)}")
    parser.add_argument("--sizes", nargs="+", metavar="SIZE", help="only these sizes of the families")
    parser.add_argument("--solvers", nargs="+", metavar="NAME", help="only these solvers, ours and others")
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="seeds of each size at the most (default: each family's own number)"
    )
    parser.add_argument(
        "--peer-limit", type=float, metavar="S", help="time limit of other solvers at the most, in seconds"
    )
    parser.add_argument(
        "--brief",
        action="store_true",
        help="everything in some 25 minutes: two seeds (ghosts up to ten), and other solvers get 5 s",
    )
    parser.add_argument(
        "--processes", type=int, default=1, metavar="N", help="seeds at a time, everybody on one core (default 1)"
    )
    parser.add_argument("--csv", type=Path, metavar="FILE", help=f"the rows (default {TABLE})")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="the report (default: beside the rows)")
    parser.add_argument(
        "--update",
        action="store_true",
        help="keep the rows of the CSV that this run does not measure (with --solvers: those of other solvers)",
    )
    parser.add_argument("--remark", metavar="TEXT", help="a remark on the rows, printed in the report")
    parser.add_argument("--report-only", action="store_true", help="run nothing; write the report again from the CSV")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(argv)
    families = [name.replace("_", " ") for name in options.families or FAMILIES]
    for name in families:
        if name not in FAMILIES:
            parser.error(f"--families: unknown {name!r}; known: {', '.join(FAMILIES)}")
    if options.seeds is not None and options.seeds < 1:
        parser.error(f"--seeds: expected at least 1, got {options.seeds}")
    if options.processes < 1:
        parser.error(f"--processes: expected at least 1, got {options.processes}")
    if options.peer_limit is not None and not options.peer_limit > 0:
        parser.error(f"--peer-limit: expected more than 0 seconds, got {options.peer_limit:g}")
    table: Path = options.csv or TABLE
    report: Path = options.markdown or table.with_suffix(".md")
    if options.report_only and not table.exists():
        parser.error(f"--report-only: {table} does not exist")

    from experiments.benchmarks import markdown as reporting
    from experiments.benchmarks import readme
    from experiments.benchmarks import rows as storage
    from experiments.common import peers

    part = options.report_only or options.update or options.families or options.sizes or options.solvers
    missing = [] if part or table != TABLE else peers.not_installed()
    if missing:
        # without them the tables would be fairer to us than they are
        parser.error(
            f"{TABLE} is of all other solvers; not installed: {', '.join(missing)} "
            "(pip install -e '.[test,peers]', or write elsewhere with --csv)"
        )

    def write(minutes: float | None) -> None:
        command = _command(options)
        storage.save(table, rows)
        # of the figures as they are saved, in so many digits: whoever reads the table comes to the same ones
        saved = storage.load(table)
        write_text(report, reporting.render(saved, minutes, command, options.remark))
        for page in filter(Path.exists, PAGES if table == TABLE else ()):
            write_text(page, readme.insert(page.read_text(encoding="utf-8"), saved))

    rows: list[Row] = []
    if options.report_only:
        rows = storage.load(table)
        if options.remark is None and report.exists():
            options.remark = reporting.remark_of(report.read_text(encoding="utf-8"))
        write(None)
        return 0
    start = time.perf_counter()
    if options.update and table.exists():
        rows = [r for r in storage.load(table) if not _measured_anew(r, families, options)]
    for found in _measure(families, options):
        rows = storage.with_common_reference(rows + found)
        rows.sort(key=lambda row: FAMILIES.index(row.family))
        # After every case, so that an interrupted run keeps what it has measured.
        write((time.perf_counter() - start) / 60 if not options.update else None)
    print(f"{len(rows)} rows in {table}, report in {report}")
    return 0


def _command(options: argparse.Namespace) -> str:
    """What to type for the same run."""
    words = ["python -m experiments.benchmarks"]
    words += ["--brief"] if options.brief else []
    for name in ("families", "sizes", "solvers"):
        if getattr(options, name):
            words += [f"--{name}", *(value.replace(" ", "_") for value in getattr(options, name))]
    words += [f"--seeds {options.seeds}"] if options.seeds else []
    words += [f"--processes {options.processes}"] if options.processes > 1 else []
    words += [f"--peer-limit {options.peer_limit:g}"] if options.peer_limit else []
    return " ".join(words)


def _to_run(what: Row | Case, families: list[str], sizes: list[str] | None) -> bool:
    return what.family in families and (sizes is None or what.size in sizes)


def _measured_anew(row: Row, families: list[str], options: argparse.Namespace) -> bool:
    """Whether a row of an earlier run is replaced: with --solvers those of the others stay."""
    solver = row.solver.split("@")[0]
    return _to_run(row, families, options.sizes) and (not options.solvers or solver in options.solvers)


def _measure(families: list[str], options: argparse.Namespace) -> Iterator[list[Row]]:
    """Yield the rows of each case as it is done."""
    from experiments.benchmarks import ranking, run
    from experiments.benchmarks.families import cases

    def log(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    chosen = [case for case in cases() if _to_run(case, families, options.sizes)]
    if options.brief:
        chosen = [replace(case, seeds=case.brief, chosen=case.chosen[: case.brief]) for case in chosen]
        options.peer_limit = options.peer_limit or _BRIEF_LIMIT
    if options.peer_limit is not None:
        chosen = [case.with_peers_within(options.peer_limit) for case in chosen]
    if options.solvers:
        chosen = [case.restricted_to(options.solvers) for case in chosen]
    if options.processes > 1:
        chosen = [case.on_one_core() for case in chosen]
    yield from run.run_all(chosen, options.seeds, options.processes, log)
    if "kbest" in families:
        yield ranking.run(2 if options.brief else options.seeds, log)


if __name__ == "__main__":
    sys.exit(main())
