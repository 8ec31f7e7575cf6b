"""A study as a table with one row per run."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.door import door
from assoc.solution import OPTIMALITY_TOLERANCE
from assoc.sweeps.store import COLUMNS, Manifest, read_log, read_manifest, run_keys

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (
    "repeat",
    "seed",
    "scene",
    "scan",
    "cost",
    "lower_bound",
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


@door
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
        ``lower_bound``, ``gap``, ``optimal``; ``iterations``; ``time`` in the solver, seconds; ``stopped_by``;
        ``true_tuples``, ``correct_tuples`` (empty if the truth is unknown); ``setting`` (its key).

    Raises
    ------
    InvalidInputError
        The folder holds no study, or a damaged one.
    """
    import pandas as pd

    manifest, settings, runs = _read(folder)
    columns = {name: [run[i] for run in runs] for i, name in enumerate(COLUMNS)}
    frame = pd.DataFrame({"solver": [settings[key]["solver"] for key in columns["setting"]]}, dtype="str")
    parameters = list(dict.fromkeys(name for setting in settings.values() for name in setting["parameters"]))
    for name in parameters:
        values = {key: _plain(setting["parameters"].get(name)) for key, setting in settings.items()}
        column = pd.Series([values[key] for key in columns["setting"]])
        frame[column_of(name)] = column
    for name in ("repeat", "seed"):
        frame[name] = np.array(columns[name], dtype=np.int64)
    frame["scene"] = pd.Series([manifest.sources.get(key, key) for key in columns["source"]], dtype="str")
    frame["scan"] = np.array(columns["scan"], dtype=np.int64)
    frame["cost"] = np.array(columns["cost"], dtype=float)
    bound = np.array(columns["lower_bound"], dtype=float)
    frame["lower_bound"] = np.where(np.isnan(bound) & ~np.isnan(frame["cost"]), -np.inf, bound)
    frame["gap"] = frame["cost"] - frame["lower_bound"]
    frame["optimal"] = frame["gap"] <= OPTIMALITY_TOLERANCE * np.maximum(1.0, frame["cost"].abs())
    frame["iterations"] = pd.array(columns["iterations"], dtype="Int64")
    frame["time"] = np.array(columns["time"], dtype=float)
    frame["stopped_by"] = pd.Series(columns["stopped_by"], dtype="str")
    for name in ("true_tuples", "correct_tuples"):
        frame[name] = pd.array(columns[name], dtype="Int64")
    frame["setting"] = pd.Series(columns["setting"], dtype="str")
    order = ["solver", *map(column_of, parameters), "scene", "scan", "repeat"]
    return frame.sort_values(order, kind="stable", ignore_index=True)


def _plain(value: Any) -> Any:
    """Return a value that can be sorted: lists, tables and long numbers of an edited log become text."""
    if isinstance(value, int) and not -(2**63) <= value < 2**63:
        return str(value)
    return value if value is None or isinstance(value, (str, bool, int, float)) else str(value)


def column_of(parameter: str) -> str:
    """Column name of a parameter."""
    return f"parameter_{parameter}" if parameter in RESULTS else parameter


@door
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

    manifest, _, runs = _read(folder)
    index = {name: i for i, name in enumerate(COLUMNS)}
    rows = [
        (run[index["setting"]], manifest.sources.get(run[index["source"]]), run[index["scan"]], run[index["repeat"]])
        + tuple(point)
        for run in runs
        for point in run[index["trace"]]
    ]
    return pd.DataFrame(rows, columns=["setting", "scene", "scan", "repeat", "iteration", "seconds", "cost"])


def _read(folder: str | os.PathLike[str]) -> tuple[Manifest, dict[str, Any], list[tuple[Any, ...]]]:
    manifest = read_manifest(folder)
    settings: dict[str, Any] = {}
    runs: dict[Any, tuple[Any, ...]] = {}
    for entry in read_log(folder):
        if entry is None:
            continue
        if "setting_key" in entry:
            settings[entry["setting_key"]] = entry
            continue
        for key, row in zip(run_keys(entry), _rows(entry), strict=True):
            # each run once, even if two processes should have done it
            runs.setdefault(key, row)
    known = [row for row in runs.values() if row[0] in settings]
    return manifest, settings, known


def _rows(batch: dict[str, list[Any]]) -> Iterator[tuple[Any, ...]]:
    return zip(*(batch[name] for name in COLUMNS), strict=True)
