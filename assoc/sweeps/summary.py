"""Settings of a study: their means with bootstrap intervals, and the difference of two, run by run."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.sweeps.frame import RESULTS, load

if TYPE_CHECKING:
    import pandas as pd

MEASURES = ("excess", "gap", "cost", "optimal", "iterations", "time", "correct")
"""Measures that are averaged; "excess" is the cost above the best known, "correct" the share of the true tuples found.

Gaps are not comparable between solvers, whose bounds differ; excesses are.
"""

FACTORS = {"optimal": 100.0, "correct": 100.0, "time": 1e3}
"""Factors of measures in printed tables: per cent, milliseconds."""

RESAMPLES, LEVEL = 2000, 0.95
_MOST_NUMBERS = 10_000_000


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
            row[measure] = estimated(runs, measure)
            row[f"{measure}_low"], row[f"{measure}_high"] = mean_interval(*_weighed(runs, measure))
        rows.append(row)
    columns = ["solver", *names, "setting", "runs", "infeasible"]
    columns += [f"{measure}{end}" for measure in MEASURES for end in ("", "_low", "_high")]
    return pd.DataFrame(rows, columns=columns)


def parameter_columns(frame: pd.DataFrame) -> list[str]:
    """Columns of the parameters."""
    if "repeat" not in frame.columns:
        raise InvalidInputError("study: expected the runs of assoc.sweeps.load, got a table without 'repeat'")
    last = list(frame.columns).index("repeat")
    return [str(name) for name in frame.columns[1:last] if name not in RESULTS]


def varied(frame: pd.DataFrame) -> list[str]:
    """Columns of the parameters that have several values within one solver."""
    names, groups = parameter_columns(frame), [part for _, part in frame.groupby("solver")]
    return [name for name in names if any(part[name].nunique() > 1 for part in groups)]


def parameter_text(value: Any) -> str:
    """Text of a parameter; empty where a solver does not have it."""
    if value is None or value != value:
        return ""
    plain = value.item() if isinstance(value, np.generic) else value
    return f"{plain:.6g}" if isinstance(plain, float) else str(plain)


def estimated(runs: pd.DataFrame, measure: str) -> float:
    """Mean of a measure over runs."""
    return weighted_mean(*_weighed(runs, measure))


def _weighed(runs: pd.DataFrame, measure: str) -> tuple[Floats, Floats | None]:
    """Values of a measure, (problems, repeats), and their weights."""
    weights = by_problem(runs, numbers(runs["true_tuples"])) if measure == "correct" else None
    return by_problem(runs, measured(runs, measure)), weights


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


@explains_wrong_types
def compare(study: pd.DataFrame | str | os.PathLike[str], first: str, second: str) -> pd.DataFrame:
    """Compare two settings of a study by the differences of their runs on the same problems with the same repeats.

    Parameters
    ----------
    study : DataFrame or path-like
        Result of `load`, or the folder of the study.
    first, second : str
        Solver, or parameters, or both, as far as they name one setting: ``"greedy"``, ``"aco,alpha=1,rho=0.3"``; or
        the setting's key.

    Returns
    -------
    DataFrame
        One row for each of ``excess``, ``gap``, ``cost``, ``optimal``, ``iterations``, ``time``, ``correct``:
        ``measure``, the means ``first`` and ``second``, ``difference`` (first less second), its 95 % interval ``low``
        and ``high`` by the bootstrap over problems and repeats, and ``pairs``. Only runs are counted for which both
        settings have a value; measures without pairs are left out.

    Raises
    ------
    InvalidInputError
        Words name no setting, or several.
    """
    frame = load(study) if isinstance(study, (str, os.PathLike)) else study
    return paired(frame, _key(frame, first), _key(frame, second), MEASURES)


def paired(frame: pd.DataFrame, first: str, second: str, measures: Sequence[str]) -> pd.DataFrame:
    """Do the same for two keys, and for measures or other columns of numbers of the frame."""
    import pandas as pd

    runs = frame[frame["setting"].isin([first, second])]
    rows = []
    for name in measures:
        pairs = runs.assign(value=measured(runs, name)).pivot_table(
            index=["scene", "scan", "repeat"], columns="setting", values="value", dropna=False
        )
        pairs = pairs.reindex(columns=[first, second]).dropna().reset_index()
        if len(pairs):
            one, other = (pairs[key].to_numpy(dtype=float).reshape(len(pairs), -1)[:, 0] for key in (first, second))
            low, high = mean_interval(by_problem(pairs, one - other))
            rows.append((name, one.mean(), other.mean(), (one - other).mean(), low, high, len(pairs)))
    return pd.DataFrame(rows, columns=["measure", "first", "second", "difference", "low", "high", "pairs"])


def _key(frame: pd.DataFrame, words: str) -> str:
    """The key of the one setting that words name."""
    found = frame.drop_duplicates("setting")
    for word in filter(None, (part.strip() for part in words.split(","))):
        name, equals, text = word.partition("=")
        if not equals:
            found = found[(found["solver"] == word) | found["setting"].str.startswith(word)]
        elif (name := name.replace("-", "_")) not in found.columns:
            raise InvalidInputError(f"{words}: no setting of the study has a parameter {name!r}")
        else:
            found = found[[_same(value, text) for value in found[name]]]
    if len(found) != 1:
        names = ", ".join(varied(found)) if len(found) else ""
        expected = f"; they differ in {names}" if names else ""
        raise InvalidInputError(f"{words}: names {len(found)} settings of the study, expected one{expected}")
    return str(found["setting"].iloc[0])


def _same(value: object, text: str) -> bool:
    try:
        return float(text) == float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return str(value).lower() == text.lower() and not (isinstance(value, float) and np.isnan(value))


def mean_interval(values: Floats, weights: Floats | None = None, *, resamples: int = RESAMPLES) -> tuple[float, float]:
    """95 % interval of the mean over problems and repeats, (P, R) with NaN where a run is missing, both resampled.

    The mean is ``sum(weights * values) / sum(weights)``; the seed is fixed, so that the interval is reproducible. NaN
    without values, and both ends equal to a single value.

    A. B. Owen, The pigeonhole bootstrap, Annals of Applied Statistics 1 (2007): resampling rows and columns is
    conservative where runs of one problem, or of one repeat, are alike.
    """
    share = np.where(np.isnan(values), 0.0, 1.0 if weights is None else weights)
    if not share.any():
        return np.nan, np.nan
    of_rows, of_columns = draws(*values.shape, resamples)
    # relative to the middle of the values, so that large equal numbers give an interval of width 0
    middle = weighted_mean(values, weights)
    away = np.where(share > 0, values - middle, 0.0)
    total = ((of_rows @ (share * away)) * of_columns).sum(axis=1)
    weight = ((of_rows @ share) * of_columns).sum(axis=1)
    means = middle + total[weight > 0] / weight[weight > 0]
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


@lru_cache(maxsize=8)
def draws(rows: int, columns: int, resamples: int) -> tuple[Floats, Floats]:
    """Number of times that each row and each column is drawn, for each resample."""
    rng = np.random.default_rng(0)
    resamples = max(200, min(resamples, _MOST_NUMBERS // max(rows, columns)))
    of_rows = rng.multinomial(rows, np.full(rows, 1 / rows), resamples).astype(float)
    of_columns = rng.multinomial(columns, np.full(columns, 1 / columns), resamples).astype(float)
    return of_rows, of_columns


def weighted_mean(values: Floats, weights: Floats | None = None) -> float:
    """Mean of the values that are not NaN; NaN if there are none or the weights are all 0."""
    known = ~np.isnan(values)
    share = np.ones(int(known.sum())) if weights is None else weights[known]
    return float(np.average(values[known], weights=share)) if share.sum() > 0 else float("nan")
