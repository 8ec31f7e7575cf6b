"""A study as a table with one row per setting: means with intervals."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.door import door
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.sweeps.bootstrap import mean_interval, weighted_mean
from assoc.sweeps.frame import RESULTS, load

if TYPE_CHECKING:
    import pandas as pd


INTERVAL = "95 %"
"""Header of the interval of the measure in the column before."""

MEASURES = ("cost", "gap", "optimal", "iterations", "time", "correct")
"""Measures that are averaged; "correct" is the share of the true tuples that were found."""

FACTORS = {"optimal": 100.0, "correct": 100.0, "time": 1e3}
"""Factors of measures in printed tables: per cent, milliseconds."""


@door
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
        ``cost``, ``gap``, ``optimal`` (the share certified optimal), ``iterations``, ``time`` (seconds) and
        ``correct`` its mean and its 95 % interval (``_low``, ``_high``) by the bootstrap over problems and repeats.
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
    titles = {"gap": "mean gap", "cost": "mean cost", "optimal": "optimal %", "time": "ms", "correct": "correct %"}
    headers = ["solver", *map(str, parameters), "runs", *infeasible]
    for name in measures:
        headers += [titles.get(name, name), INTERVAL]
    cells = []
    for row in summary.to_dict("records"):
        line = [str(row["solver"]), *(_value(row[name]) for name in parameters), str(row["runs"])]
        line += [str(row[name]) for name in infeasible]
        for name in measures:
            factor = FACTORS.get(name, 1.0)
            line.append(_number(factor * row[name], name))
            line.append(_interval([factor * row[f"{name}_low"], factor * row[f"{name}_high"]], name))
        cells.append(line)
    if brief:
        kept = [i for i, header in enumerate(headers) if header != INTERVAL or any(_spread(row, i) for row in cells)]
        headers, cells = [headers[i] for i in kept], [[row[i] for i in kept] for row in cells]
    return headers, cells


def _value(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.6g}"
    return "" if value is None else str(value)


def _number(value: float, name: str) -> str:
    if np.isnan(value):
        return "-"
    if name == "cost":
        return f"{value:.4f}"
    return f"{value:.2f}" if name in ("optimal", "correct", "iterations") else f"{value:.3g}"


def _spread(row: Sequence[str], column: int) -> bool:
    """Whether an interval has a width, so that it adds to the value before it."""
    return row[column] not in ("-", f"{row[column - 1]} .. {row[column - 1]}")


def _interval(ends: Sequence[float], name: str) -> str:
    return "-" if np.isnan(ends[0]) else f"{_number(ends[0], name)} .. {_number(ends[1], name)}"
