"""The scene in plan: truth, measurements, sensors, gates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.plotting.axes import axes_or_new, box_around, legend, set_plan_view, stacked, unit_of
from assoc.plotting.colours import BLACK, GREY, colour, marker
from assoc.plotting.measured import distances_to_border, positions_of
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, Sensor


@explains_wrong_types
def plot_scene(
    scene: Scene,
    scan: int | None = None,
    *,
    ax: Any = None,
) -> Any:
    """Draw sensors, targets and measurements.

    Parameters
    ----------
    scene : Scene
    scan : int, optional
        The scan to draw; default: all measurements, and the truth as paths.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes
    """
    ax = axes_or_new(ax)
    chosen = [scene.scan(scan)] if scan is not None else [scene.scan(k) for k in range(scene.num_scans)]
    middle = float(scene.region[2].mean())
    chosen = [scan.aligned(scene.sensors) for scan in chosen]
    stands = [scene.at(scan.time).sensors for scan in chosen]
    found = [
        [_ends(scene, then[s], scan.measurements[s], middle) for then, scan in zip(stands, chosen, strict=True)]
        for s in range(len(scene.sensors))
    ]
    # carried sensors are drawn where they stand in the last of the scans
    sensors = stands[-1]
    sites = stacked(sensor.position for sensor in sensors)
    truth = [] if scene.truth is None else [scan.truth_positions for scan in chosen]
    named = [part for row, sensor in zip(found, scene.sensors, strict=True) for part in row if not _bears(sensor)]
    near, far = stacked([sites, *truth]), stacked(named)
    unit = unit_of(np.concatenate([near, far]))
    for s, (sensor, row) in enumerate(zip(sensors, found, strict=True)):
        ends = unit.factor * stacked(row)
        label = sensor.name or f"sensor {s + 1}"
        if _bears(sensor):
            draw_rays(ax, unit.factor * sensor.position, ends, color=colour(s), linewidth=0.5, alpha=0.5, label=label)
            continue
        size = 3.0 if scan is None else 7.0 - (s % 3)
        style: dict[str, Any] = {"markerfacecolor": "none"} if scan is not None else {"alpha": 0.5}
        ax.plot(*ends[:, :2].T, marker(s), color=colour(s), markersize=size, label=label, **style)
    draw_truth(ax, scene, chosen, unit.factor, paths=len(chosen) > 1)
    draw_sensors(ax, sensors, unit.factor)
    set_plan_view(ax, box_around(near, far), unit)
    legend(ax)
    return ax


def _bears(sensor: Sensor) -> bool:
    return isinstance(sensor, BearingSensor)


def _ends(scene: Scene, sensor: Sensor, z: Array, height: float) -> Array:
    """Positions of measurements; for bearings, the points where their rays leave the region."""
    distance = distances_to_border(sensor, z[:, 0], scene.region) if _bears(sensor) else 0.0
    return positions_of(sensor, z, height, distance)


def draw_rays(ax: Any, site: Array, ends: Array, **style: Any) -> None:
    """Draw lines from a sensor to these points (n, 2 or 3)."""
    lines = np.full((len(ends), 3, 2), np.nan)
    lines[:, 0], lines[:, 1] = site[:2], ends[:, :2]
    ax.plot(*lines.reshape(-1, 2).T, **style)


def draw_truth(ax: Any, scene: Scene, scans: Sequence[Scan], factor: float, *, paths: bool) -> None:
    """Draw true positions: paths over the scans, or crosses."""
    if scene.truth is None:
        return
    if not paths:
        where = factor * stacked(scan.truth_positions for scan in scans)
        ax.plot(*where[:, :2].T, "+", color=BLACK, markersize=11, markeredgewidth=1.4, label="truth", zorder=4)
        return
    known = truth_paths(scene)
    lines = [np.concatenate([factor * path[:, :2], [[np.nan, np.nan]]]) for path in known.values()]
    if lines:
        ax.plot(*np.concatenate(lines).T, color=BLACK, linewidth=1.2, label="truth", zorder=4)


def truth_paths(scene: Scene) -> dict[int, Array]:
    """Positions (n, 3) of each target over the scans, by its id; metres."""
    paths: dict[int, list[Array]] = {}
    if scene.truth is not None:
        for ids, where in zip(scene.truth.target_ids, scene.truth.positions, strict=True):
            for target, place in zip(ids, where, strict=True):
                paths.setdefault(int(target), []).append(place)
    return {target: np.array(path) for target, path in paths.items()}


def draw_sensors(ax: Any, sensors: Sequence[Sensor], factor: float) -> None:
    """Draw the sensors' positions."""
    sites = factor * stacked(sensor.position for sensor in sensors)
    ax.plot(*sites[:, :2].T, "^", color=GREY, markersize=9, markeredgecolor=BLACK, label="sensors", zorder=3)
