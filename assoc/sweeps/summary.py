"""A study as a table with one row per setting: means with intervals."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.sweeps.bootstrap import mean_interval, weighted_mean
from assoc.sweeps.frame import RESULTS, load

if TYPE_CHECKING:
    import pandas as pd


INTERVAL = "95 %"
"""Header of the interval of the measure in the column before."""

MEASURES = ("excess", "gap", "cost", "optimal", "iterations", "time", "correct")
"""Measures that are averaged; "excess" is the cost above the best known, "correct" the share of the true tuples found.

Gaps are not comparable between solvers, whose bounds differ; excesses are.
"""

TITLES = {
    "excess": "mean excess",
    "gap": "mean gap",
    "cost": "mean cost",
    "optimal": "optimal %",
    "time": "ms",
    "correct": "correct %",
    "score": "PAR10, s",
}
"""Headers of the measures, in the units of `FACTORS`."""

FACTORS = {"optimal": 100.0, "correct": 100.0, "time": 1e3}
"""Factors of measures in printed tables: per cent, milliseconds."""


@explains_wrong_types
def summarize(study: pd.DataFrame | str | os.PathLike[str]) -> pd.DataFrame:
    """Average the runs of each setting.

    Parameters
    ----------
    study : DataFrame or path-like
        Result of `load`, or the folder of the study.

    Returns
    -------
    DataFrame
        One row per setting: ``solver``, the parameters that differ, ``setting``, ``runs``, and for each of
        ``excess`` (cost above the best known), ``gap``, ``cost``, ``optimal`` (the share certified optimal),
        ``iterations``, ``time`` (seconds) and ``correct`` its mean and its 95 % interval (``_low``, ``_high``) by the
        bootstrap over problems and repeats.
        ``infeasible`` counts the runs without a solution; no mean includes them.
    """
    import pandas as pd

    frame = load(study) if isinstance(study, (str, os.PathLike)) else study
    names = varied(frame)
    rows: list[dict[str, Any]] = []
    for key, runs in frame.groupby("setting", sort=False):
        first = runs.iloc[0]
        row: dict[str, Any] = {"solver": first["solver"], **{name: first[name] for name in names}, "setting": key}
        row["runs"] = len(runs)
        row["infeasible"] = int(runs["cost"].isna().sum())
        for measure in MEASURES:
            table = by_problem(runs, measured(runs, measure))
            weights = by_problem(runs, numbers(runs["true_tuples"])) if measure == "correct" else None
            row[measure] = weighted_mean(table, weights)
            row[f"{measure}_low"], row[f"{measure}_high"] = mean_interval(table, weights)
        rows.append(row)
    columns = ["solver", *names, "setting", "runs", "infeasible"]
    columns += [f"{measure}{end}" for measure in MEASURES for end in ("", "_low", "_high")]
    return pd.DataFrame(rows, columns=columns)


def varied(frame: pd.DataFrame) -> list[str]:
    """Columns of the parameters that have several values within one solver."""
    if "repeat" not in frame.columns:
        raise InvalidInputError("study: expected the runs of assoc.sweeps.load, got a table without 'repeat'")
    last = list(frame.columns).index("repeat")
    names = [str(name) for name in frame.columns[1:last] if name not in RESULTS]
    groups = [part for _, part in frame.groupby("solver")]
    return [name for name in names if any(part[name].nunique() > 1 for part in groups)]


def by_problem(runs: pd.DataFrame, values: Floats) -> Floats:
    """Values of runs as an array (problems, repeats), with NaN where there is no run."""
    problem = runs.groupby(["scene", "scan"], sort=True).ngroup().to_numpy()
    repeats, column = np.unique(runs["repeat"].to_numpy(), return_inverse=True)
    table = np.full((int(problem.max()) + 1, len(repeats)), np.nan)
    table[problem, column] = values
    return table


def measured(runs: pd.DataFrame, measure: str) -> Floats:
    """Values of a measure for each run; NaN where it has none.

    ``correct`` is the share of the true tuples of a run; its means are weighted by their number.
    """
    if measure == "correct":
        true = numbers(runs["true_tuples"])
        return np.divide(numbers(runs["correct_tuples"]), true, out=np.full(len(runs), np.nan), where=true > 0)
    values = numbers(runs[measure])
    if measure == "optimal":
        return np.where(runs["cost"].isna(), np.nan, values)
    if measure == "gap":
        # a gap within rounding errors is 0
        values = np.where(values <= 1e-9 * np.maximum(1.0, runs["cost"].abs()), 0.0 * values, values)
    return np.where(np.isfinite(values), values, np.nan)


def numbers(column: pd.Series[Any]) -> Floats:
    """Return a column as floats, NaN where it is empty."""
    return column.to_numpy(dtype=float, na_value=np.nan)


def summary_rows(summary: pd.DataFrame, *, brief: bool = False) -> tuple[list[str], list[list[str]]]:
    """Headers and cells of a summary for display; the columns before "runs" identify the setting.

    ``brief`` leaves out the intervals of measures that are equal in all runs.
    """
    parameters = list(summary.columns[1 : list(summary.columns).index("setting")])
    measures = [name for name in MEASURES if summary[name].notna().any()]
    infeasible = ["infeasible"] if summary["infeasible"].any() else []
    headers = ["solver", *map(str, parameters), "runs", *infeasible]
    for name in measures:
        headers += [TITLES.get(name, name), INTERVAL]
    cells = []
    for row in summary.to_dict("records"):
        line = [str(row["solver"]), *(_value(row[name]) for name in parameters), str(row["runs"])]
        line += [str(row[name]) for name in infeasible]
        for name in measures:
            factor = FACTORS.get(name, 1.0)
            line.append(number(factor * row[name], name))
            line.append(interval([factor * row[f"{name}_low"], factor * row[f"{name}_high"]], name))
        cells.append(line)
    if brief:
        kept = [i for i, header in enumerate(headers) if header != INTERVAL or any(_spread(row, i) for row in cells)]
        headers, cells = [headers[i] for i in kept], [[row[i] for i in kept] for row in cells]
    return headers, cells


def _value(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.6g}"
    return "" if value is None else str(value)


def comparison_rows(table: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Headers and cells of a comparison (`assoc.sweeps.compare`)."""
    cells = []
    for row in table.to_dict("records"):
        name, factor = row["measure"], FACTORS.get(row["measure"], 1.0)
        means = [number(factor * row[column], name) for column in ("first", "second", "difference")]
        ends = interval([factor * row["low"], factor * row["high"]], name)
        cells.append([TITLES.get(name, name), *means, ends, str(row["pairs"])])
    return ["", "first", "second", "difference", INTERVAL, "pairs"], cells


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


def number(value: float, name: str) -> str:
    """Return a value of a measure as text."""
    if np.isnan(value):
        return "-"
    if name == "cost":
        return f"{value:.4f}"
    return f"{value:.2f}" if name in ("optimal", "correct", "iterations") else f"{value:.3g}"


def _spread(row: Sequence[str], column: int) -> bool:
    """Whether an interval has a width, so that it adds to the value before it."""
    return row[column] not in ("-", f"{row[column - 1]} .. {row[column - 1]}")


def interval(ends: Sequence[float], name: str) -> str:
    """Return an interval of a measure as text."""
    return "-" if np.isnan(ends[0]) else f"{number(ends[0], name)} .. {number(ends[1], name)}"
