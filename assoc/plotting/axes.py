"""Axes to draw into, the caller's or new ones, and units of length."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from assoc._system.imports import load_extra
from assoc._types import Array

_KILOMETRES_FROM = 3_000.0
_OUTLIERS = 3.0
_WIDE, _TALL = 1.5, 1.1


def axes_or_new(ax: Any) -> Any:
    """Return the axes given, or those of a new figure."""
    if ax is not None:
        return ax
    return load_extra("matplotlib.pyplot", "plot").subplots(figsize=(7.0, 5.0), layout="constrained")[1]


class Unit(NamedTuple):
    """A unit of length: its name, and its factor from metres."""

    name: str
    factor: float


def unit_of(points: Array) -> Unit:
    """Metres for what is near the origin, kilometres beyond 3 km."""
    far = points.size and np.abs(points[:, :2]).max() > _KILOMETRES_FROM
    return Unit("km", 1e-3) if far else Unit("m", 1.0)


def stacked(parts: Iterable[Any]) -> Array:
    """Positions (N, 3) of all parts, each (n, 3) or one position (3,)."""
    rows = [np.asarray(part, dtype=np.float64).reshape(-1, 3) for part in parts]
    return np.concatenate([np.zeros((0, 3)), *rows])


def box_around(near: Array, far: Array) -> Array:
    """Bounds (2, 2) of x and y around all of `near` and most of `far`, with a margin, metres.

    A few distant false alarms or ghosts must not shrink everything else to a dot.
    """
    corners = [near[:, :2]] if len(near) else []
    if len(far):
        corners.append(np.percentile(far[:, :2], [_OUTLIERS, 100.0 - _OUTLIERS], axis=0))
    if not corners:
        return np.array([[-1.0, 1.0], [-1.0, 1.0]])
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = np.maximum(0.06 * (high - low), 0.06 * (high - low).max() + 1e-9)
    return np.stack([low - margin, high + margin], axis=1)


def set_plan_view(ax: Any, box: Array, unit: Unit) -> None:
    """Make axes a map: equal scales, bounds, units."""
    middle, width = box.mean(axis=1), np.ptp(box, axis=1)
    # limits the aspect ratio
    width = np.maximum(width, [width[1] / _TALL, width[0] / _WIDE])
    ax.set_xlim(*(unit.factor * (middle[0] + np.array([-0.5, 0.5]) * width[0])))
    ax.set_ylim(*(unit.factor * (middle[1] + np.array([-0.5, 0.5]) * width[1])))
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(f"x ({unit.name})")
    ax.set_ylabel(f"y ({unit.name})")
    ax.grid(alpha=0.25, linewidth=0.6)


def set_log_x(ax: Any) -> None:
    """Make the x axis logarithmic, with plain numbers: powers of ten overlap where it spans less than a decade."""
    ticker = load_extra("matplotlib.ticker", "plot")
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(ticker.LogFormatter(labelOnlyBase=True))
    ax.xaxis.set_minor_formatter(ticker.LogFormatter(minor_thresholds=(2.0, 0.4)))


def legend(ax: Any, **options: Any) -> None:
    """Add a legend below the axes, where it hides nothing, unless it would be empty."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        ax.legend(
            handles,
            labels,
            **{"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 4, "fontsize": 8, "frameon": False}
            | options,
        )
