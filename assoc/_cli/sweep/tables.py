"""Printed tables of parameter studies."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from assoc._cli.lines import print_lines
from assoc._cli.table import print_table
from assoc._text.plain import printable
from assoc.sweeps.summary import INTERVAL, comparison_rows, summary_rows

if TYPE_CHECKING:
    import pandas as pd

    from assoc.sweeps.tuning import Report


def print_study(table: pd.DataFrame, most: int) -> None:
    """Print the summary of a study, all of it if stdout is not a terminal.

    A terminal gets the first ``most`` settings, and a line with the values that all settings share.
    """
    brief = sys.stdout.isatty()
    headers, rows = summary_rows(table, brief=brief)
    keys = headers.index("runs")
    same = ""
    if brief:
        headers, rows, same = without_the_same(headers, rows, keys)
    shown = most if brief else len(rows)
    print_table(headers, rows[:shown], keys=keys, joined=[INTERVAL])
    if len(rows) > shown:
        print(f"... and {len(rows) - shown} more settings (--all shows them)")
    if same:
        print_lines(f"in all settings: {same}")
    print()


def without_the_same(
    headers: Sequence[str], rows: Sequence[Sequence[str]], keys: int
) -> tuple[list[str], list[list[str]], str]:
    """Remove the columns, after the first ``keys``, whose cells are all equal; return them as words."""
    if len(rows) < 2:
        return [*headers], [[*row] for row in rows], ""
    same = [i for i in range(keys, len(headers)) if len({row[i] for row in rows}) == 1]
    # an interval stays with its value
    same = [i for i in same if (i if headers[i] != INTERVAL else i - 1) in same]
    same = [i for i in same if headers[i + 1 : i + 2] != [INTERVAL] or i + 1 in same]
    words: list[str] = []
    for i in same:
        if headers[i] == INTERVAL:
            words[-1] += f" ({INTERVAL}: {rows[0][i]})"
        else:
            words.append(f"{headers[i]} {rows[0][i]}")
    kept = [i for i in range(len(headers)) if i not in same]
    return [headers[i] for i in kept], [[row[i] for i in kept] for row in rows], ", ".join(words)


def print_tuning(report: Report) -> None:
    """Print the result of a search, and its quality on the held-out runs."""
    unit, factor = ("cost", 1.0) if report.target == "gap" else ("ms", 1e3)
    changed = {
        name: value for name, value in report.tuned.parameters.items() if value != report.default.parameters[name]
    }
    words = ", ".join(
        f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}" for name, value in changed.items()
    )
    what = "mean gap" if report.target == "gap" else "time to optimum (PAR10)"
    print_lines(f"{report.solver}, {report.trials} trials: {words or 'the defaults are best'}")
    print_lines(f"training: {what} {factor * report.training[0]:.4g} -> {factor * report.training[1]:.4g} {unit}")
    print_lines(f"held out: {report.held_out}")
    table = report.table
    print_comparison(table if report.target == "time" else table[table["measure"] != "score"], "tuned", "default")


def print_comparison(table: pd.DataFrame, first: str, second: str) -> None:
    """Print the paired differences of two settings."""
    headers, rows = comparison_rows(table)
    print_table(headers, rows, left=[""], joined=[INTERVAL])
    print_lines(
        f"first: {printable(first)}; second: {printable(second)}; difference: first less second, in pairs of runs"
    )
