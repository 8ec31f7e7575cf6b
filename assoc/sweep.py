"""``python -m assoc.sweep``: runs a study of solver parameters, on one core, on all, or on a cluster.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import import_modules
from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Given, read_first
from assoc._cli.program import Program
from assoc._cli.progress import ProgressBar
from assoc._cli.signals import Interruption
from assoc._cli.sweep_options import OUTPUTS, SHOWN, make_study, read_comparison, read_options, tune_parameters
from assoc._cli.sweep_options import parser as parser
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    import pandas as pd

    from assoc._cli.sweep_tables import Rows
    from assoc.sweeps.study import Counts, Study

# seconds between two lines of -v
_EVERY = 5.0
_INTERRUPTION = Interruption("assoc.sweep")


def _sweep(words: list[str]) -> None:
    if words[:1] == ["import"]:
        _import(words[1:])
        return
    if words[:1] == ["compare"]:
        _compare(read_comparison(words[1:]))
        return
    import_modules(read_first(words, "import")["import"])
    given, tables = read_options(words)
    with messages(given):
        if given["summary"] is not None:
            _report(given["summary"], given, None)
        elif given["tune"] is not None:
            _tune(given)
        else:
            _run(given, tables)


def _run(given: Given, tables: dict[str, Any]) -> None:
    folder, study = given["output"], make_study(given, tables)
    with _watched(given) as progress:
        counts = study.run(folder, jobs=given["jobs"] or 1, scheduler=given["scheduler"], progress=progress)
    _report(folder, given, study)
    spread = f", {1e3 * counts.solving / counts.new:.3g} ms a run in the solver" if counts.new else ""
    found = f"{counts.new} new, {counts.before} there before{spread}"
    print_lines(f"{counts.total} runs in {printable(folder)}: {found}")


def _report(folder: str, given: Given, study: Study | None) -> None:
    """Print the table of a folder, only of the study's settings if one is given; write the requested outputs."""
    from assoc._cli.sweep_tables import print_study, summary_rows
    from assoc.sweeps.frame import load
    from assoc.sweeps.summary import summarize

    frame = load(folder)
    if study is not None:
        frame = frame[frame["setting"].isin([setting.key for setting in study.settings])].reset_index(drop=True)
    table = summarize(frame)
    print_study(table, len(table) if given["all"] else SHOWN)
    _write_table(given["csv"], table, summary_rows)
    if given["heatmap"] or given["convergence"]:
        from assoc.plotting.study_figures import draw_convergence, draw_heat_maps

        drawn = draw_heat_maps(frame, given["heatmap"]) if given["heatmap"] else []
        drawn += [draw_convergence(folder, given["convergence"], frame)] if given["convergence"] else []
        for path in drawn:
            print_lines(f"drawn: {printable(str(path))}")
    if given["report"]:
        from assoc.plotting.report import write_sweep_report

        write_sweep_report(given["report"], folder, frame, words=given.words)


def _write_table(file: str | None, table: pd.DataFrame, rows: Callable[[pd.DataFrame], Rows]) -> None:
    """Write a table as CSV, or its rows for LaTeX."""
    from assoc._cli.sweep_tables import latex
    from assoc._files.output import write_text

    if file:
        write_text(
            file, latex(*rows(table)) if file.endswith(".tex") else table.to_csv(index=False, lineterminator="\n")
        )


def _compare(given: Given) -> None:
    from assoc._cli.sweep_tables import comparison_rows, print_comparison
    from assoc.sweeps.summary import compare

    table = compare(given["folder"], given["first"], given["second"])
    print_comparison(table, given["first"], given["second"])
    _write_table(given["csv"], table, comparison_rows)


def _import(words: list[str]) -> None:
    from assoc.sweeps.old_form import import_study

    if len(words) != 2:
        raise InvalidInputError("import: expected two folders: assoc sweep import OLD NEW")
    runs, damaged = import_study(*words)
    left_out = f"; {damaged} damaged lines are left out" if damaged else ""
    print_lines(f"{runs} runs in {printable(words[1])}{left_out}")


def _tune(given: Given) -> None:
    from assoc._cli.sweep_tables import print_tuning

    with _watched(given) as progress:
        report = tune_parameters(given, progress)
    print_tuning(report)
    if any(given[name] for name in OUTPUTS):
        _report(given["output"], given, None)


@contextmanager
def _watched(given: Given) -> Iterator[Any]:
    """Show progress on a terminal, with -v also elsewhere, and explain after Ctrl-C how to continue."""
    next_line = 0.0 if given["verbose"] and not sys.stderr.isatty() else math.inf

    def message(kept: str) -> str:
        return f"{kept} are kept in {printable(given['output'])}; the same command goes on from there"

    with ProgressBar("runs", "runs", shown=not given["quiet"]) as bar:

        def progress(counts: Counts) -> None:
            _INTERRUPTION.message = message(f"{counts.done} of {counts.total} runs")
            nonlocal next_line
            bar(counts)
            if time.monotonic() >= next_line or (counts.done == counts.total and next_line < math.inf):
                next_line = time.monotonic() + _EVERY
                bar.say(f"{counts.done} of {counts.total} runs")

        _INTERRUPTION.message = message("finished runs")
        with _INTERRUPTION.reported(bar.close):
            yield progress


PROGRAM = Program("assoc.sweep", _sweep, _INTERRUPTION.interrupt_on_signals, _INTERRUPTION)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())
