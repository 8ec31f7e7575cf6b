"""Data of a scan for the figures of a report, as plain numbers for JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.association.scan import ScanAssociation
from assoc.association.source import Source
from assoc.costs import tuple_costs
from assoc.plotting.measured import measures_height
from assoc.plotting.solution import measured_positions
from assoc.problem import AssignmentProblem
from assoc.scene.geodesy import geodetic
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor
from assoc.sensors.base import ANGLES

BUDGET = 2_800_000
"""Limit on the bytes of all views in a page; plotly, packed, takes 1.9 MB more."""

_LINES_OF_TRACE = 200


def plain_numbers(values: Array | Sequence[float], decimals: int) -> list[Any]:
    """Nested lists of rounded numbers, integers if `decimals` is 0; None where not finite."""
    array = np.round(np.asarray(values, dtype=np.float64), decimals)
    if not np.isfinite(array).all():
        return [
            plain_numbers(value, decimals) if np.ndim(value) else (float(value) if np.isfinite(value) else None)
            for value in array
        ]
    if decimals <= 0 and array.size and np.abs(array).max() < 2**53:
        array = array.astype(np.int64)
    return array.tolist()


def number(value: float | None) -> float | None:
    """Return the value for JSON: None if it is not finite."""
    return float(value) if value is not None and math.isfinite(value) else None


def closed_gap(scan: ScanAssociation) -> float | None:
    """Return the gap, 0 if it is only rounding; None without a bound."""
    gap = scan.solution.gap
    return 0.0 if gap <= 1e-9 * max(1.0, abs(scan.solution.cost)) else number(gap)


def source_view(source: Source, file: str) -> dict[str, Any]:
    """Sensors and extent of a source."""
    if isinstance(source, AssignmentProblem):
        names = [f"sensor {s + 1}" for s in range(source.num_sensors)]
        return {"file": file, "title": file, "scene": False, "sensors": [{"name": name} for name in names]}
    sensors = []
    for s, sensor in enumerate(source.at(float(source.times[-1])).sensors):
        sensors.append(
            {
                "name": sensor.name or f"sensor {s + 1}",
                "place": plain_numbers(sensor.position, 1),
                "components": list(sensor.components[: sensor.position_part.dim]),
                "angles": [name in ANGLES for name in sensor.components[: sensor.position_part.dim]],
                "sigma": np.sqrt(np.diagonal(sensor.covariance)).tolist(),
                "ray": isinstance(sensor, BearingSensor),
            }
        )
    return {
        "file": file,
        "title": source.name or file,
        "scene": True,
        "sensors": sensors,
        "height": any(measures_height(sensor) for sensor in source.sensors),
        "decimals": _decimals(source),
    }


def _decimals(scene: Scene) -> int:
    """Decimals of a metre that are visible when zoomed in to a hundredth of the noise."""
    reach = float(np.abs(scene.region).max())
    return 0 if reach > 20_000 else 1 if reach > 2_000 else 3


def _trace(association: ScanAssociation) -> list[list[float | None]]:
    trace = association.solution.trace
    step = max(1, math.ceil(len(trace) / _LINES_OF_TRACE))
    # the last line is the final answer and is always kept
    kept = [*trace[:-1:step], *trace[-1:]]
    return [[line.iteration, number(line.seconds), number(line.cost), number(line.lower_bound)] for line in kept]


def scan_view(source: Source, number_of_source: int, associated: ScanAssociation) -> dict[str, Any]:
    """Figures of a scan, its targets and its history; `scene_view` adds what is drawn."""
    solution = associated.solution
    tuples = associated.targets
    costs: Array
    if associated.costs is not None:
        costs = associated.costs
    elif isinstance(source, AssignmentProblem):
        rows = map(tuple, solution.tuples.tolist())
        known = dict(zip(rows, source.costs[solution.indices].tolist(), strict=True))
        costs = np.array([known[tuple(row)] for row in tuples.tolist()])
    else:
        costs = tuple_costs(source, associated.scan, tuples)
    return {
        "source": number_of_source,
        "scan": associated.scan,
        "time": number(associated.time),
        "sizes": list(associated.sizes),
        "targets": len(tuples),
        "falseAlarms": associated.false_alarms,
        "cost": number(solution.cost),
        "bound": number(solution.lower_bound),
        "gap": closed_gap(associated),
        "status": solution.status,
        "ms": 1e3 * solution.runtime,
        "trueTuples": associated.true_tuples,
        "correct": associated.correct_tuples,
        "ranked": [number(other.solution.cost) for other in associated.ranked],
        "tuples": tuples.tolist(),
        "costs": plain_numbers(costs, 4),
        "probabilities": None
        if associated.probabilities is None
        else [plain_numbers(row, 4) for row in associated.probabilities],
        "trace": _trace(associated),
        "view": None,
    }


def scene_view(scene: Scene, associated: ScanAssociation, decimals: int) -> dict[str, Any]:
    """Return the drawing of a scan: truth, measurements, targets with residuals and covariances.

    Measurements with times of their own have no residuals: the target has moved since.
    """
    scan = scene.scan(associated.scan).aligned(scene.sensors)
    standing = scene.at(scan.time)
    positions = np.zeros((0, 3)) if associated.positions is None else associated.positions
    spreads = np.zeros((0, 3, 3)) if associated.covariances is None else associated.covariances
    measured, residuals = [], []
    for s, (at, label) in enumerate(measured_positions(scene, associated)):
        sensor = standing.sensors[s].position_part
        z = scan.measurements[s][:, : sensor.dim]
        entry: dict[str, Any] = {"at": plain_numbers(at, decimals), "target": label.tolist()}
        if scan.sources is not None:
            entry["source"] = scan.sources[s].tolist()
        measured.append(entry)
        # one row for each target that this sensor detected, in the order of the targets
        seen = np.flatnonzero(associated.targets[:, s])
        found = z[associated.targets[seen, s] - 1]
        difference = sensor.residual(found, sensor.measure(positions[seen])) if len(seen) else found
        residuals.append(_significant(difference))
    truth = []
    if scan.truth_ids is not None and scan.truth_positions is not None:
        truth = [
            [int(i), *place]
            for i, place in zip(scan.truth_ids, plain_numbers(scan.truth_positions, decimals), strict=True)
        ]
    sigmas = np.sqrt(np.diagonal(spreads, axis1=1, axis2=2))
    earth = {}
    if scene.origin is not None:
        earth["degrees"] = plain_numbers(np.degrees(geodetic(positions, scene.origin)[:, :2]), 5)
    return {
        **earth,
        "truth": truth,
        "measured": measured,
        "positions": plain_numbers(positions, decimals),
        "sigmas": plain_numbers(sigmas, 1),
        "ellipses": _significant(spreads[:, [0, 0, 1], [0, 1, 1]]),
        "residuals": residuals if scan.times is None else None,
    }


def _significant(values: Array) -> list[Any]:
    """Nested lists of numbers with four digits."""
    return [[float(f"{value:.4g}") for value in row] for row in values.tolist()]


def thin(views: Iterable[dict[str, Any]], wanted: Sequence[dict[str, Any]], budget: int = BUDGET) -> int:
    """Attach views to the `wanted` scans within a budget of bytes; return how many have one, evenly spaced if not all.

    The view of each scan is made on demand.
    """
    sizes = []
    for view, scan in zip(views, wanted, strict=True):
        scan["view"] = view
        sizes.append(len(json.dumps(view, separators=(",", ":"))))
    step = 1
    while step < len(sizes) and sum(sizes[::step]) > budget:
        step += 1
    for number_of, scan in enumerate(wanted):
        if number_of % step:
            scan["view"] = None
    return len(sizes[::step])
