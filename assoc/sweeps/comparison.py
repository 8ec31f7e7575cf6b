"""Two settings of a study, compared run by run: on the same problem, with the same repeat."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.sweeps.bootstrap import mean_interval
from assoc.sweeps.frame import load
from assoc.sweeps.summary import MEASURES, by_problem, measured, varied

if TYPE_CHECKING:
    import pandas as pd


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
