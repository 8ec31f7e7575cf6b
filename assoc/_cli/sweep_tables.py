"""Printed tables of parameter studies."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from assoc._cli.lines import print_lines
from assoc._cli.table import print_table
from assoc._text.plain import printable
from assoc.sweeps.summary import FACTORS, MEASURES, parameter_text

if TYPE_CHECKING:
    import pandas as pd

    from assoc.sweeps.tuning import Report

Rows = tuple[list[str], list[list[str]]]
"""Headers and cells of a table."""

INTERVAL = "95 %"
"""Header of the interval of the measure in the column before."""

_TITLES = {
    "excess": "mean excess",
    "gap": "mean gap",
    "cost": "mean cost",
    "optimal": "optimal %",
    "time": "ms",
    "correct": "correct %",
    "score": "PAR10, s",
}
"""Headers of the measures, in the units of `FACTORS`."""


def print_study(table: pd.DataFrame, most: int) -> None:
    """Print the summary of a study, all of it if stdout is not a terminal.

    A terminal gets the first ``most`` settings, and only those measures in which settings differ.
    """
    brief = sys.stdout.isatty() and len(table) > 1
    headers, rows = summary_rows(table, [name for name in MEASURES if not brief or table[name].nunique() > 1])
    shown = rows[:most] if sys.stdout.isatty() else rows
    print_table(headers, shown)
    if len(rows) > len(shown):
        print(f"... and {len(rows) - most} more settings (--all shows them)")
    print()


def summary_rows(summary: pd.DataFrame, measures: Sequence[str] = MEASURES) -> Rows:
    """Headers and cells of a summary; the columns before "runs" identify the setting."""
    parameters = list(summary.columns[1 : list(summary.columns).index("setting")])
    measures = [name for name in measures if summary[name].notna().any()]
    infeasible = ["infeasible"] if summary["infeasible"].any() else []
    headers = ["solver", *map(str, parameters), "runs", *infeasible]
    headers += [header for name in measures for header in (_TITLES.get(name, name), INTERVAL)]
    cells = []
    for row in summary.to_dict("records"):
        line = [str(row["solver"]), *(parameter_text(row[name]) for name in parameters), str(row["runs"])]
        line += [str(row[name]) for name in infeasible]
        for name in measures:
            line += [_number(row[name], name), _interval(row[f"{name}_low"], row[f"{name}_high"], name)]
        cells.append(line)
    return headers, cells


def comparison_rows(table: pd.DataFrame) -> Rows:
    """Headers and cells of a comparison (`assoc.sweeps.compare`)."""
    cells = []
    for row in table.to_dict("records"):
        name = row["measure"]
        means = [_number(row[column], name) for column in ("first", "second", "difference")]
        cells.append([_TITLES.get(name, name), *means, _interval(row["low"], row["high"], name), str(row["pairs"])])
    return ["", "first", "second", "difference", INTERVAL, "pairs"], cells


def _number(value: float, name: str) -> str:
    """Text of a value of a measure."""
    if np.isnan(value):
        return "-"
    digits = {"cost": ".4f", "optimal": ".2f", "correct": ".2f", "iterations": ".2f"}
    return format(FACTORS.get(name, 1.0) * value, digits.get(name, ".3g"))


def _interval(low: float, high: float, name: str) -> str:
    return "-" if np.isnan(low) else f"{_number(low, name)} .. {_number(high, name)}"


def latex(headers: Sequence[str], cells: Sequence[Sequence[str]]) -> str:
    """A table for LaTeX, without a package; text stands left, numbers right."""
    escapes = {ord(sign): f"\\{sign}" for sign in "&%$#_{}"} | {
        ord("\\"): r"\textbackslash{}", ord("~"): r"\textasciitilde{}", ord("^"): r"\textasciicircum{}"
    }  # fmt: skip
    kinds = "".join("r" if all(_is_numeric(row[i]) for row in cells) else "l" for i in range(len(headers)))
    lines = [" & ".join(cell.translate(escapes).replace(" .. ", " -- ") for cell in row) for row in (headers, *cells)]
    body = "".join(f"{line} \\\\\n" for line in lines[1:])
    return f"\\begin{{tabular}}{{{kinds}}}\n\\hline\n{lines[0]} \\\\\n\\hline\n{body}\\hline\n\\end{{tabular}}\n"


def _is_numeric(cell: str) -> bool:
    return all(part in ("", "-") or part.lstrip("-")[:1].isdigit() for part in cell.split(" .. "))


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
    print_table(headers, rows, left=[""])
    print_lines(
        f"first: {printable(first)}; second: {printable(second)}; difference: first less second, in pairs of runs"
    )
