"""Tracks over the truth, in plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, box_around, legend, set_plan_view, unit_of
from assoc.plotting.colours import BLACK, DASHES, GREY, colour
from assoc.plotting.scene import truth_paths
from assoc.scene.scene import Scene
from assoc.sensors.arrays import finite_array

if TYPE_CHECKING:
    import pandas as pd

_NAMED = 12


@explains_wrong_types
def plot_tracks(tracks: pd.DataFrame, truth: Scene | None = None, *, ax: Any = None) -> Any:
    """Draw tracks, each in its own colour and dashes, over the paths of the targets.

    Parameters
    ----------
    tracks : DataFrame
        Columns track_id, time, x, y (metres) at least, as in a tracks.csv.
    truth : Scene, optional
        Its truth is drawn under the tracks, in wide grey lines.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        A column is missing, or a position is not a number.
    """
    missing = [name for name in ("track_id", "time", "x", "y") if name not in tracks.columns]
    if missing:
        raise InvalidInputError(f"tracks: the column {missing[0]!r} is missing")
    far = finite_array(tracks[["x", "y"]].to_numpy(), "tracks: x, y", (len(tracks), 2))
    ax = axes_or_new(ax)
    paths = [] if truth is None else [*truth_paths(truth).values()]
    near = np.concatenate([np.zeros((0, 2)), *(path[:, :2] for path in paths)])
    unit = unit_of(np.concatenate([near, far]))
    for number, path in enumerate(paths):
        style = {"color": GREY, "alpha": 0.3, "linewidth": 6, "solid_capstyle": "round"}
        ax.plot(*(unit.factor * path[:, :2]).T, label="truth" if number == 0 else None, **style)
    several = tracks["track_id"].nunique()
    for number, (name, track) in enumerate(tracks.sort_values("time", kind="stable").groupby("track_id")):
        line = unit.factor * track[["x", "y"]].to_numpy(dtype=np.float64)
        label = f"track {name}" if several <= _NAMED else None
        # after seven the colours repeat with other dashes
        dashes = DASHES[(number + number // len(DASHES)) % len(DASHES)]
        ax.plot(*line.T, color=colour(number), linestyle=dashes, linewidth=1.8, label=label)
        ax.plot(*line[0], "o", color=BLACK, markersize=4, label="first point" if number == 0 else None)
    set_plan_view(ax, box_around(near, far), unit)
    legend(ax)
    return ax
