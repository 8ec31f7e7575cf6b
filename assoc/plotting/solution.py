"""A solution in plan: chosen tuples as links, false alarms, covariance ellipses."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.association.scan import ScanAssociation
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, box_around, legend, set_plan_view, stacked, unit_of
from assoc.plotting.colours import BLACK, GREY, SKY, colour, marker
from assoc.plotting.measured import distances_to_border, ellipses, positions_of, scan_of
from assoc.plotting.scene import draw_rays, draw_sensors, draw_truth
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor


@explains_wrong_types
def plot_solution(
    scene: Scene, association: ScanAssociation, *, target: int | None = None, probability: float = 0.95, ax: Any = None
) -> Any:
    """Draw which measurements of a scan were associated, and the positions of their targets.

    Parameters
    ----------
    scene : Scene
    association : ScanAssociation
        Association of one of its scans: ``assoc.associate(scene).scans[k]``.
    target : int, optional
        Draw only the surroundings of this target (a row of ``association.targets``).
    probability : float
        Probability content of the covariance ellipses, in (0, 1).
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        The association belongs to another scene, has no positions or no such target; or the probability is invalid.
    """
    if association.positions is None or association.covariances is None:
        raise InvalidInputError("association: has no positions, expected one made from a scene")
    if target is not None and not 0 <= target < len(association.targets):
        raise InvalidInputError(f"target: expected 0 to {len(association.targets) - 1}, got {target!r}")
    if not 0.0 < probability < 1.0:
        raise InvalidInputError(f"probability: expected a number between 0 and 1, got {probability!r}")
    scan = scan_of(scene, association)
    ax = axes_or_new(ax)
    found = association.positions
    drawn = measured_positions(scene, association)
    standing = scene.at(scan.time).sensors
    sites = stacked(sensor.position for sensor in standing)
    truth = stacked([] if scan.truth_positions is None else [scan.truth_positions])
    rays = [isinstance(sensor, BearingSensor) for sensor in scene.sensors]
    far = stacked([found, *(at for (at, _), ray in zip(drawn, rays, strict=True) if not ray)])
    near = np.concatenate([sites, truth])
    x, y = ellipses(found, association.covariances, probability)
    if target is not None:
        taken = [at[label == target] for at, label in drawn]
        outline = np.array(np.split(np.stack([x, y], axis=1), len(found)))[target]
        points = np.concatenate([outline[:-1], stacked([found[target], *taken])[:, :2]])
        reach = 1.3 * np.abs(points - found[target, :2]).max()
        box = np.stack([found[target, :2] - reach, found[target, :2] + reach], axis=1)
    else:
        box = box_around(near, far)
    unit = unit_of(np.concatenate([near, far]))
    if target is not None and np.ptp(box, axis=1).max() < 3_000.0:
        unit = unit_of(np.zeros((0, 3)))
    f = unit.factor
    for ray, sensor, (at, label) in zip(rays, standing, drawn, strict=True):
        if ray:
            for chosen, how in ((label >= 0, {"color": SKY}), (label < 0, {"color": GREY, "linestyle": ":"})):
                draw_rays(ax, f * sensor.position, f * at[chosen], linewidth=0.6, zorder=1, **how)
    links, lost = [], []
    for s, (sensor, (at, label)) in enumerate(zip(scene.sensors, drawn, strict=True)):
        kept = label >= 0
        links += [[start, found[t], np.full(3, np.nan)] for start, t in zip(at[kept], label[kept], strict=True)]
        lost.append(at[~kept] if not rays[s] else at[:0])
        name, size = sensor.name or f"sensor {s + 1}", 9.0 - 2.0 * (s % 3)
        style = {"markerfacecolor": "none", "markeredgewidth": 1.3, "color": colour(s)}
        ax.plot(*(f * at[kept, :2]).T, marker(s), markersize=size, label=name, **style)
    ax.plot(*(f * stacked(links)[:, :2]).T, color=BLACK, linewidth=0.8, label="association", zorder=2)
    ax.plot(f * x, f * y, color=BLACK, linewidth=0.8, linestyle=":", label=f"{100 * probability:g} % ellipses")
    away = f * stacked(lost)[:, :2]
    if len(away):
        ax.plot(*away.T, "x", color=GREY, markersize=5, label="false alarms")
    ax.plot(*(f * found[:, :2]).T, ".", color=BLACK, markersize=6, label="targets found", zorder=5)
    draw_truth(ax, scene, [scan], f, paths=False)
    draw_sensors(ax, standing, f)
    set_plan_view(ax, box, unit)
    legend(ax)
    return ax


def measured_positions(scene: Scene, association: ScanAssociation) -> list[tuple[Array, Array]]:
    """Where to draw the measurements of each sensor in an associated scan, (n, 3), metres, and their targets (n,).

    Coordinates that a sensor does not measure (height, distance along a bearing) are those of the associated target, a
    row of ``association.targets``; a false alarm, -1, of a bearing ends at the border of the region.
    """
    scan = scene.scan(association.scan).aligned(scene.sensors)
    scene = scene.at(scan.time)
    found = np.zeros((0, 3)) if association.positions is None else association.positions
    result = []
    for sensor, z, label in zip(scene.sensors, scan.measurements, association.labels(), strict=True):
        kept = label >= 0
        height, distance = np.full(len(z), scene.region[2].mean()), np.zeros(len(z))
        if isinstance(sensor, BearingSensor):
            distance = distances_to_border(sensor, z[:, 0], scene.region)
        if kept.any():
            owner = found[label[kept]]
            height[kept] = owner[:, 2]
            distance[kept] = np.hypot(*(owner[:, :2] - sensor.position[:2]).T)
        result.append((positions_of(sensor, z, height, distance), label))
    return result
