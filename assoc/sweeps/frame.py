"""A study as a table with one row per run, and as the course of its runs over time."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.solution import OPTIMALITY_TOLERANCE
from assoc.sweeps.store import COLUMNS, Store

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (
    "repeat",
    "seed",
    "scene",
    "scan",
    "cost",
    "lower_bound",
    "excess",
    "gap",
    "optimal",
    "iterations",
    "time",
    "stopped_by",
    "true_tuples",
    "correct_tuples",
    "setting",
)
"""Columns of the table after ``solver`` and the parameters."""
_CURVE_POINTS = 60


@explains_wrong_types
def load(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Read the runs of a study, which may still be running.

    Parameters
    ----------
    folder : path-like

    Returns
    -------
    DataFrame
        One row per run, in the order of solver, parameters, scene, scan, repeat. Columns:
        ``solver``; the parameters (empty where a solver does not have one; a parameter with the name of a result,
        such as ``iterations``, is ``parameter_iterations``); ``repeat``; ``seed`` (``assoc.assign`` with this
        seed repeats the run); ``scene`` (the name of scene or problem), ``scan``; ``cost``,
        ``lower_bound``, ``excess`` (cost less the least that any run of the folder has found for this scan), ``gap``,
        ``optimal``; ``iterations``; ``time`` in the solver, seconds; ``stopped_by``;
        ``true_tuples``, ``correct_tuples`` (empty if the truth is unknown); ``setting`` (its key).

    Raises
    ------
    InvalidInputError
        The folder holds no study, or a damaged one.
    """
    import pandas as pd

    with Store(folder) as store:
        sources, settings = store.manifest.sources, store.settings()
        runs = [run for run in store.select(f"{', '.join(COLUMNS[:-1])} FROM runs") if run[0] in settings]
    columns = {name: [run[i] for run in runs] for i, name in enumerate(COLUMNS[:-1])}
    frame = pd.DataFrame({"solver": [settings[key][0] for key in columns["setting"]]}, dtype="str")
    for name in dict.fromkeys(name for _, parameters in settings.values() for name in parameters):
        values = {key: _plain(parameters.get(name)) for key, (_, parameters) in settings.items()}
        frame[f"parameter_{name}" if name in RESULTS else name] = pd.Series([values[key] for key in columns["setting"]])
    for name in ("repeat", "seed"):
        frame[name] = np.array(columns[name], dtype=np.int64)
    frame["scene"] = pd.Series([sources.get(key, key) for key in columns["source"]], dtype="str")
    frame["scan"] = np.array(columns["scan"], dtype=np.int64)
    frame["cost"] = np.array(columns["cost"], dtype=float)
    bound = np.array(columns["lower_bound"], dtype=float)
    frame["lower_bound"] = np.where(np.isnan(bound) & ~np.isnan(frame["cost"]), -np.inf, bound)
    frame["excess"] = _excess(frame["cost"], frame.groupby(["scene", "scan"])["cost"].transform("min"))
    frame["gap"] = frame["cost"] - frame["lower_bound"]
    frame["optimal"] = frame["gap"] <= OPTIMALITY_TOLERANCE * np.maximum(1.0, frame["cost"].abs())
    frame["iterations"] = pd.array(columns["iterations"], dtype="Int64")
    frame["time"] = np.array(columns["time"], dtype=float)
    frame["stopped_by"] = pd.Series(columns["stopped_by"], dtype="str")
    for name in ("true_tuples", "correct_tuples"):
        frame[name] = pd.array(columns[name], dtype="Int64")
    frame["setting"] = pd.Series(columns["setting"], dtype="str")
    order = [*frame.columns[: list(frame.columns).index("repeat")], "scene", "scan", "repeat"]
    return frame.sort_values(order, kind="stable", ignore_index=True)


def _excess(cost: pd.Series[Any], best: pd.Series[Any]) -> pd.Series[Any]:
    """Cost above the best known one of the same scan; rounding errors do not count."""
    excess = cost - best
    return excess.mask(excess <= 1e-9 * best.abs().clip(lower=1.0), 0.0)


def _plain(value: Any) -> Any:
    """Return a value that can be sorted: lists, tables and long numbers of an edited file become text."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return str(value)
    return value if value is None or isinstance(value, (str, bool, int, float)) else str(value)


@explains_wrong_types
def load_traces(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Read how the runs of a study converged.

    Parameters
    ----------
    folder : path-like

    Returns
    -------
    DataFrame
        One row per saved improvement (at most 16 for each run): ``setting``, ``scene``, ``scan``,
        ``repeat``, ``iteration``, ``seconds``, ``cost``.
    """
    import pandas as pd

    with Store(folder) as store:
        sources, runs = store.manifest.sources, store.select("setting, source, scan, repeat, trace FROM runs")
    keys = [(setting, sources.get(source, source), scan, repeat) for setting, source, scan, repeat, _ in runs]
    traces = [np.frombuffer(run[-1], dtype="<f8").reshape(-1, 3) for run in runs]
    points = np.concatenate([np.empty((0, 3)), *traces])
    if not np.isfinite(points).all() or np.abs(points[:, 0]).max(initial=0.0) > 2.0**53:
        raise InvalidInputError(f"{store.path}: is damaged (a trace holds what is no number)")
    frame = pd.DataFrame(keys, columns=["setting", "scene", "scan", "repeat"])
    frame = frame.loc[np.repeat(np.arange(len(runs)), [len(trace) for trace in traces])].reset_index(drop=True)
    return frame.assign(iteration=points[:, 0].astype(np.int64), seconds=points[:, 1], cost=points[:, 2])


def with_excess(frame: pd.DataFrame, traces: pd.DataFrame) -> pd.DataFrame:
    """Traces of the runs of a frame; the column ``excess`` is the cost above the best known one of the scan."""
    best = (frame["cost"] - frame["excess"]).groupby([frame["scene"], frame["scan"]]).min().rename("best")
    traces = traces[traces["setting"].isin(frame["setting"].unique())].join(best, on=["scene", "scan"])
    # of a scan that came since the frame was read none is known
    return traces.assign(excess=_excess(traces["cost"], traces["best"]).fillna(0.0))


def mean_excess(traces: pd.DataFrame, column: str) -> tuple[Floats, Floats]:
    """Average the excess of runs over time, each run with its best solution so far.

    ``traces`` are from `with_excess`, not empty; ``column`` is "iteration" or "seconds". Returns iterations, or
    milliseconds, (n,), and the mean cost above the best known, (n,).
    """
    factor = 1e3 if column == "seconds" else 1.0
    at = np.maximum(factor * traces[column].to_numpy(dtype=float), 1e-3)
    run = traces.groupby(["scene", "scan", "repeat"]).ngroup().to_numpy()
    excess = traces["excess"].to_numpy(dtype=float)
    first = float(np.quantile(at[np.unique(run, return_index=True)[1]], 0.5))
    grid = np.unique(np.geomspace(min(first, at.max()), at.max() * 1.02, _CURVE_POINTS))
    total = np.zeros(grid.size)
    order = np.lexsort((at, run))
    starts = np.flatnonzero(np.r_[True, np.diff(run[order]) > 0])
    for rows in np.split(order, starts[1:]):
        index = np.searchsorted(at[rows], grid, side="right") - 1
        total += excess[rows][np.maximum(index, 0)]
    return grid, total / starts.size
