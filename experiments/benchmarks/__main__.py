"""Our solvers and others' on families of problems: docs/benchmarks.csv and .md, tables of README.md and paper.md."""

import argparse
import math
import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from assoc._files.output import write_text
from experiments.benchmarks import markdown, ranking
from experiments.benchmarks import rows as storage
from experiments.benchmarks.families import Case, Entry, cases, on_one_core
from experiments.benchmarks.rows import Row
from experiments.benchmarks.run import run_all
from experiments.common import contestants
from experiments.common.command import whole

TABLE, PAGES = Path("docs/benchmarks.csv"), (Path("README.md"), Path("paper.md"))
# what a brief run gives other solvers, in seconds
_BRIEF_LIMIT = 5.0
FAMILIES = (*dict.fromkeys(case.family for case in cases()), "kbest")


def _family(text: str) -> str:
    name = text.replace("_", " ")
    if name not in FAMILIES:
        raise argparse.ArgumentTypeError(f"unknown {name!r}; known: {', '.join(FAMILIES)}")
    return name


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m experiments.benchmarks",
        description="Run our solvers and other people's on the benchmark families; write the rows, the report "
        f"and, for {TABLE}, the tables of README.md and paper.md.",
    )
    add = parser.add_argument
    add("--families", nargs="+", type=_family, metavar="NAME", help=f"only these: {', '.join(FAMILIES)}")
    add("--sizes", nargs="+", metavar="SIZE", help="only these sizes of the families")
    add("--solvers", nargs="+", metavar="NAME", help="only these solvers, ours and others")
    add(
        "--seeds", type=whole(1), metavar="N", help="seeds of each size at the most (default: each family's own number)"
    )
    text = f"everything in some 25 minutes: two seeds (ghosts up to ten), and other solvers get {_BRIEF_LIMIT:g} s"
    add("--brief", action="store_true", help=text)
    text = "seeds at a time, everybody on one core (default 1)"
    add("--processes", type=whole(1), default=1, metavar="N", help=text)
    add("--csv", type=Path, default=TABLE, metavar="FILE", help=f"the rows (default {TABLE})")
    text = "keep the rows of the CSV that this run does not measure (with --solvers: those of other solvers)"
    add("--update", action="store_true", help=text)
    text = "keep all rows of the CSV, and run only families and sizes that have none: go on after an interruption"
    add("--resume", action="store_true", help=text)
    add("--report-only", action="store_true", help="run nothing; write the report again from the CSV")
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark; returns the exit code."""
    parser = _parser()
    options = parser.parse_args(argv)
    table: Path = options.csv
    report = table.with_suffix(".md")
    if options.report_only:
        if not table.exists():
            parser.error(f"--report-only: {table} does not exist")
        _tell(table, report, markdown.head_of(report.read_text(encoding="utf-8") if report.exists() else ""))
        return 0
    part = options.update or options.resume or options.families or options.sizes or options.solvers
    missing = [] if part or table != TABLE else contestants.not_installed()
    if missing:
        # without them the tables would be fairer to us than they are
        parser.error(
            f"{TABLE} is of all other solvers; not installed: {', '.join(missing)} "
            "(pip install -e '.[test,peers]', or write elsewhere with --csv)"
        )
    start = time.perf_counter()
    command = shlex.join(["python", "-m", "experiments.benchmarks", *(sys.argv[1:] if argv is None else argv)])
    rows: list[Row] = []
    if (options.update or options.resume) and table.exists():
        rows = [row for row in storage.load(table) if options.resume or not _measured_anew(row, options)]
    for found in _measure(options, {(row.family, row.size) for row in rows} if options.resume else set()):
        rows = storage.with_common_reference(rows + found)
        rows.sort(key=lambda row: FAMILIES.index(row.family))
        # after every case, so that an interrupted run keeps what it has measured
        storage.save(table, rows)
        minutes = None if options.update or options.resume else (time.perf_counter() - start) / 60
        _tell(table, report, markdown.head(minutes, command))
    print(f"{len(rows)} rows in {table}, report in {report}")
    return 0


def _tell(table: Path, report: Path, head: str | None) -> None:
    """Write what is told of the rows in a file: of the figures as they are saved, in so many digits."""
    saved = storage.load(table)
    write_text(report, markdown.render(saved, head))
    for page in filter(Path.exists, PAGES if table == TABLE else ()):
        write_text(page, markdown.insert(page.read_text(encoding="utf-8"), saved))


def _to_run(what: Row | Case, options: argparse.Namespace) -> bool:
    return what.family in (options.families or FAMILIES) and what.size in (options.sizes or [what.size])


def _measured_anew(row: Row, options: argparse.Namespace) -> bool:
    """Whether a row of an earlier run is replaced: with --solvers those of the others stay."""
    return _to_run(row, options) and (not options.solvers or row.solver.split("@")[0] in options.solvers)


def _measure(options: argparse.Namespace, done: set[tuple[str, str]]) -> Iterator[list[Row]]:
    """Yield the rows of each case as it is done; families and sizes that are done already are left out."""

    def log(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    chosen = [case for case in cases() if _to_run(case, options) and (case.family, case.size) not in done]
    if options.brief:
        chosen = [replace(case, seeds=case.seeds[: case.brief]) for case in chosen]
    limit = _BRIEF_LIMIT if options.brief else math.inf

    def change(entry: Entry) -> Entry | None:
        if options.solvers and entry.solver not in options.solvers:
            return None
        changed = replace(entry, limit=min(entry.limit, limit)) if entry.peer else entry
        return on_one_core(changed) if options.processes > 1 else changed

    chosen = [case.changed(change) for case in chosen]
    yield from run_all(chosen, options.seeds, options.processes, log)
    if "kbest" in (options.families or FAMILIES) and ("kbest", ranking.PLANAR) not in done:
        yield ranking.run(2 if options.brief else options.seeds, log)


if __name__ == "__main__":
    sys.exit(main())
