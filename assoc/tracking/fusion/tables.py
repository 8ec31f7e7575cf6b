"""Fusion of tables of tracks, such as files of several systems."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.reading import open_input
from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.plain import one_line
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.tracking.fusion.systems import SystemTracks, open_states
from assoc.tracking.fusion.track_fusion import FusionParameters, TrackFusion
from assoc.tracking.track_table import TrackTable

if TYPE_CHECKING:
    import pandas as pd

_CSV = ("track_id", "time", "x", "y", "z", "vx", "vy", "vz")
_SIGMAS = ("sigma_x", "sigma_y", "sigma_z")
# metres, m/s and seconds, and the least standard deviation: squares and their inverses stay numbers
_LARGEST, _LEAST_SIGMA = 1e12, 1e-6


@explains_wrong_types
def fuse_tables(
    tables: Sequence[TrackTable | pd.DataFrame | str | os.PathLike[str]],
    parameters: FusionParameters | None = None,
    *,
    interval: float | None = None,
    sigma: float = 100.0,
    sigma_velocity: float = 20.0,
) -> TrackTable:
    """Fuse tables of tracks of several systems into one.

    Parameters
    ----------
    tables : sequence of TrackTable, DataFrame or path
        Columns as in tracks.csv: track_id, time, x, y, z, vx, vy, vz, and sigma_x, sigma_y, sigma_z and existence if
        known. All in one frame and of one clock. `assoc.integrations.asterix.read_tracks` reads category 062.
    parameters : FusionParameters, optional
    interval : float, optional
        Seconds from picture to picture; default: the usual seconds between two times of the slowest system. A track
        counts until twice as long after its last row.
    sigma, sigma_velocity : float
        Standard deviations of positions where a table has none, and of velocities, metres and m/s.

    Raises
    ------
    InvalidInputError
        There is no table, one cannot be read or lacks a column.
    """
    frames = [_frame(table, number) for number, table in enumerate(tables, 1)]
    if not frames:
        raise InvalidInputError("tables: expected at least one")
    positive(sigma, "sigma")
    positive(sigma_velocity, "sigma_velocity")
    times = [np.unique(frame["time"].to_numpy(dtype=np.float64)) for frame in frames]
    paces = [float(np.median(np.diff(own))) for own in times if len(own) > 1]
    pace = max(paces, default=1.0) if interval is None else positive(interval, "interval")
    every = np.concatenate(times)
    fusion, table = TrackFusion(len(frames), parameters), TrackTable()
    first, last = (float(every.min()), float(every.max())) if len(every) else (0.0, -1.0)
    for time in _pictures(every, first, last, pace):
        found = []
        for frame in frames:
            begin, end = np.searchsorted(frame["time"], [time - 2.0 * pace, time + 1e-9], side="right")
            rows = frame.iloc[begin:end].drop_duplicates("track_id", keep="last")
            latest = _of_rows(rows, sigma, sigma_velocity)
            found.append(latest.moved(time - rows["time"].to_numpy(dtype=np.float64), fusion.parameters.noise))
        table.add(fusion.step(float(time), found).tracks)
    return table


def _pictures(times: Array, first: float, last: float, pace: float) -> Array:
    """Times of the pictures in which some row may count: one wrong time makes no others, however far it is."""
    count = (last - first) / pace + 1e-9
    if not count < 2**53:
        raise InvalidInputError(f"interval: {pace:.3g} s is too short for times that are {last - first:.3g} s apart")
    numbers = np.floor((times - first) / pace)[:, None] + np.arange(4)
    return np.asarray(first + pace * np.unique(numbers[numbers <= np.floor(count)]))


def _frame(table: Any, number: int) -> pd.DataFrame:
    """A table as rows sorted by time, without tracks that are not confirmed."""
    import pandas as pd

    name = f"table {number}"
    if isinstance(table, TrackTable):
        table = table.to_frame()
    elif isinstance(table, (str, os.PathLike)):
        name = os.fspath(table)
        try:
            with open_input(table) as file:
                table = pd.read_csv(file, low_memory=False)
        except InvalidInputError:
            raise
        except (OSError, ValueError) as error:
            raise InvalidInputError(f"{name}: cannot be read as a table of tracks ({one_line(error)[:100]})") from None
    if not isinstance(table, pd.DataFrame):
        raise InvalidInputError(f"{name}: expected a TrackTable, a DataFrame or a path, got {type(table).__name__}")
    for column in _CSV:
        if column not in table or table[column].dtype.kind not in "iuf":
            raise InvalidInputError(f"{name}: expected numbers in the column {column!r}")
    needed = table[["track_id", "time", "x", "y"]].to_numpy(dtype=np.float64)
    if not np.isfinite(needed).all() or not (needed[:, 0] > 0).all():
        raise InvalidInputError(f"{name}: expected a track_id above 0, time, x and y in each row")
    _check_optional(table, name)
    if "confirmed" in table:
        table = table[table["confirmed"].astype(bool)]
    return table.sort_values("time", kind="stable")


def _check_optional(table: pd.DataFrame, name: str) -> None:
    """Refuse values beyond all reason, and text where a number stands: rows may have too many cells or too few."""
    for column in (*_CSV[1:], *_SIGMAS, "existence"):
        if column not in table:
            continue
        if table[column].dtype.kind not in "iuf":
            raise InvalidInputError(f"{name}: expected numbers in the column {column!r}")
        value = table[column].to_numpy(dtype=np.float64)
        value = value[~np.isnan(value)]
        low, high = (0.0, 1.0) if column == "existence" else (-_LARGEST, _LARGEST)
        if not ((value >= low) & (value <= high)).all():
            raise InvalidInputError(f"{name}: expected numbers from {low:g} to {high:g} in the column {column!r}")
        if column in _SIGMAS and ((value > 0.0) & (value < _LEAST_SIGMA)).any():
            raise InvalidInputError(f"{name}: expected standard deviations of {_LEAST_SIGMA:g} m or more in {column!r}")
    if "confirmed" in table and table["confirmed"].dtype.kind not in "biuf":
        raise InvalidInputError(f"{name}: expected True or False in the column 'confirmed'")


def _of_rows(rows: pd.DataFrame, sigma: float, sigma_velocity: float) -> SystemTracks:
    """The tracks of rows of a table; missing values are open, missing standard deviations as given."""
    mean, covariance = open_states(len(rows))
    values = rows[list(_CSV[2:])].to_numpy(dtype=np.float64)
    sigmas = np.full(values.shape, sigma_velocity)
    sigmas[:, :3] = rows.reindex(columns=[*_SIGMAS]).fillna(sigma).to_numpy(dtype=np.float64)
    known = np.isfinite(values) & (sigmas > 0.0)
    known[:, 5] &= known[:, 2]
    mean[known] = values[known]
    diagonal = np.einsum("nii->ni", covariance)
    diagonal[known] = sigmas[known] ** 2
    existence = rows["existence"].fillna(1.0) if "existence" in rows else np.ones(len(rows))
    return SystemTracks(rows["track_id"].to_numpy(dtype=np.int64), mean, covariance, np.asarray(existence, float))
