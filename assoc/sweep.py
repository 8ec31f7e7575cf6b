"""``python -m assoc.sweep``: a study of solver parameters, on one core, on all, or on a cluster.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from assoc._cli.imports import HELP as IMPORT_HELP
from assoc._cli.imports import import_modules
from assoc._cli.inputs import check_ending
from assoc._cli.lines import print_lines
from assoc._cli.options import add_common_options, read_first
from assoc._cli.program import Parser, command, prepare_streams, run_program
from assoc._cli.progress import ProgressBar, ProgressLog
from assoc._cli.signals import Interruption
from assoc._cli.speech import add_speech_options, spoken
from assoc._system.extras import check_extra
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.sweeps.study import Counts, Study

_SHOWN = 20
_EXTRAS = (
    ("report", "plotly", "report"),
    ("plot", "matplotlib", "plot"),
    ("tune", "optuna", "tune"),
    ("scheduler", "distributed", "dask"),
)
"""Option, the package that it needs, and the extra that brings it."""
_INTERRUPTION = Interruption("assoc.sweep")


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as a process of its own."""
    prepare_streams()
    _INTERRUPTION.interrupt_on_signals()
    return main(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _sweep(words), "assoc.sweep", _INTERRUPTION)


def _sweep(words: list[str]) -> None:
    import_modules(read_first("assoc.sweep", words, ["import"])["import"])
    parsed = vars(_parser().parse_args(words))
    speech = {name: parsed.pop(name) for name in ("quiet", "verbose", "import")}
    given = {name: value for name, value in parsed.items() if value is not None}
    for option, package, extra in _EXTRAS:
        if option in given:
            check_extra(package, extra)
    given["words"] = words
    with spoken(quiet=speech["quiet"], outputs=[given.get("csv"), given.get("report")]):
        _run(given, speech)


def _run(given: dict[str, Any], speech: dict[str, Any]) -> None:
    if "summary" in given:
        _summary(given)
        return
    from assoc._cli.sweep.options import check_study_outputs, read_options

    options = read_options(given)
    inputs = [*options.values["files"], options.config]
    check_study_outputs(options.output, [given.get("csv"), given.get("report")], inputs)
    _check_endings(given)
    if options.tune is not None:
        _tune(options, given, speech)
        return
    study = options.study()
    with _watched(options.output, speech) as progress:
        counts = study.run(options.output, jobs=options.jobs, scheduler=options.scheduler, progress=progress)
    _report(options.output, given, study)
    spread = f", {1e3 * counts.solving / counts.new:.3g} ms a run in the solver" if counts.new else ""
    found = f"{counts.new} new, {counts.before} there before{spread}"
    print_lines(f"{counts.total} runs in {printable(options.output)}: {found}")


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    from assoc.solvers import registry

    return {**_parser().flags(), "--solver": registry.names(), "--target": ("gap", "time")}


def _parser() -> Parser:
    called = command("sweep")
    parser = Parser(
        prog="assoc.sweep",
        usage=f"{called} FILE.npz [FILE.npz ...] --solver NAME --grid NAME=V1,V2 ... -o FOLDER [options]\n"
        f"       {called} --config STUDY.toml\n"
        f"       {called} --summary FOLDER [--all] [--plot] [--csv FILE] [--report FILE]",
        description="Run solvers with many parameter settings on scenes and problems, and keep every result.\n"
        "The same command again runs only what is missing.",
    )
    add = parser.add_argument
    add("files", nargs="*", metavar="FILE", help="scene.npz or problem.npz")
    add("--solver", nargs="+", metavar="NAME", help="one or more solvers (default aco)")
    add(
        "--grid",
        nargs="+",
        metavar="NAME=V1,V2",
        help="parameter values; every combination is run. SOLVER.NAME=... is for one of several solvers; "
        "--random and --tune also take ranges LOW:HIGH or LOW:HIGH:log",
    )
    add("--random", metavar="N", help="run N random settings from the values and ranges of --grid")
    add("--config", metavar="FILE", help="read these options from a TOML file; parameter values in tables [solver]")
    add("--repeats", metavar="N", help="runs of each setting on each scan, each with its own seed (default 1)")
    add_common_options(parser, ["seed", "time_limit"])
    add("--scans", metavar="A:B", help="only scans A to B-1 of each scene, counted from 0; A alone is one scan")
    add_common_options(parser, ["gate_probability", "max_tuples"])
    add("-o", "--output", metavar="FOLDER", help="folder of the study")
    add_common_options(parser, ["jobs"])
    add("--scheduler", metavar="ADDRESS", help="run on a dask cluster: tcp://host:port")
    add("--tune", metavar="N", help="search for good parameters in the ranges of --grid, with N trials")
    add("--target", metavar="NAME", help="what --tune minimises: gap (mean gap, default) or time (time to optimum)")
    add("--summary", metavar="FOLDER", help="print the table of a study; run nothing")
    text = f"print all settings on a terminal, not only the first {_SHOWN}"
    add("--all", action="store_const", const=True, help=text)
    add("--csv", metavar="FILE", help="write the table as CSV")
    add("--report", metavar="FILE", help="write an HTML page: table, heat maps, convergence (needs assoc[report])")
    add("--import", metavar="MODULE", help=IMPORT_HELP)
    add_speech_options(parser, "where the study is, every five seconds, also without a terminal")
    add("--plot", action="store_const", const=True, help="draw heatmap.png and convergence.png into the folder")
    return parser


def _check_endings(given: dict[str, Any]) -> None:
    check_ending(given.get("csv"), "--csv", ".csv", strict=False)
    check_ending(given.get("report"), "--report", ".html", ".htm", strict=False)


def _summary(given: dict[str, Any]) -> None:
    strange = sorted({*given} - {"summary", "csv", "plot", "report", "all", "words", "files"})
    if strange or given["files"]:
        raise InvalidInputError(
            "--summary: runs nothing and can be combined only with --all, --plot, --csv and --report, "
            f"not with {(strange or given['files'])[0]}"
        )
    from assoc._cli.sweep.options import check_study_outputs

    check_study_outputs(given["summary"], [given.get("csv"), given.get("report")], [])
    _check_endings(given)
    _report(given["summary"], given, None)


def _report(folder: str, given: dict[str, Any], study: Study | None) -> None:
    """Print the table of a folder, of the study's own settings if that is given; write what is asked for."""
    from assoc._cli.sweep.tables import print_study
    from assoc.sweeps.frame import load
    from assoc.sweeps.store import damaged_lines
    from assoc.sweeps.summary import summarize

    frame = load(folder)
    if study is not None:
        frame = frame[frame["setting"].isin([setting.key for setting in study.settings])].reset_index(drop=True)
    table = summarize(frame)
    print_study(table, len(table) if "all" in given else _SHOWN)
    damaged = damaged_lines(folder)
    if damaged and study is None:
        print_lines(f"{damaged} damaged lines of the log are ignored; the same sweep again repeats their runs")
    if "csv" in given:
        from assoc._files.output import write_text

        write_text(given["csv"], table.to_csv(index=False, lineterminator="\n"))
    if "plot" in given:
        from assoc.plotting.study_figures import draw_study

        for path in draw_study(folder, frame):
            print_lines(f"drawn: {printable(str(path))}")
    if "report" in given:
        from assoc.plotting.report import write_sweep_report

        write_sweep_report(given["report"], folder, frame, words=given["words"])


def _tune(options: Any, given: dict[str, Any], speech: dict[str, Any]) -> None:
    from assoc._cli.sweep.tables import print_tuning

    with _watched(options.output, speech) as progress:
        report = options.tuning(progress)
    print_tuning(report)
    if {"plot", "csv", "report"} & {*given}:
        _report(options.output, given, None)


@contextmanager
def _watched(folder: str, speech: dict[str, Any]) -> Iterator[Any]:
    """Show progress on a terminal, with -v also elsewhere, and say on Ctrl-C how to go on."""
    log = ProgressLog(not speech["verbose"] or sys.stderr.isatty())

    def message(kept: str) -> str:
        return f"{kept} are kept in {printable(folder)}; the same command goes on from there"

    with ProgressBar("runs", "runs", shown=not speech["quiet"]) as bar:

        def progress(counts: Counts) -> None:
            _INTERRUPTION.message = message(f"{counts.done} of {counts.total} runs")
            bar(counts)
            log(counts)

        _INTERRUPTION.message = message("finished runs")
        with _INTERRUPTION.reported(bar.close):
            yield progress


if __name__ == "__main__":
    raise SystemExit(start())
