"""The scenes of a report: truth, measurements, association and false alarms of each scan, with a slider."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._text.html import escape
from assoc._text.times import moment
from assoc._types import Array
from assoc.association.scan import ScanAssociation
from assoc.plotting.axes import Unit, box_around, stacked, unit_of
from assoc.plotting.colours import BLACK, GREY, SKY, colour
from assoc.plotting.measured import ellipses
from assoc.plotting.report.figures import (
    BUDGET,
    FAINT,
    Dicts,
    evenly,
    joined,
    plan,
    points,
    scatter,
    sliding,
    within_budget,
)
from assoc.plotting.scene import truth_paths
from assoc.plotting.solution import measured_positions
from assoc.scene.geodesy import geodetic
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, Sensor
from assoc.sensors.base import ANGLES

_SYMBOLS = ("circle-open", "square-open", "triangle-up-open", "diamond-open", "triangle-down-open", "pentagon-open")
_CROWD = 40


def scene_figure(
    scene: Scene, scans: Sequence[ScanAssociation], costs: Sequence[Array], share: int = 1
) -> tuple[Dicts, int]:
    """The scene of some scans with the costs of their targets, in a share of the budget; how many of them are drawn."""
    kept = evenly(len(scans))
    drawn = {i: measured_positions(scene, scans[i]) for i in kept}
    rays = [isinstance(sensor, BearingSensor) for sensor in scene.sensors]
    sites = stacked(sensor.position for sensor in scene.at(scans[0].time or 0.0).sensors)
    paths = truth_paths(scene)
    crowded = max(len(scan.targets) for scan in scans) > _CROWD
    # many targets fill the view
    near = np.concatenate([sites[: 0 if crowded else None], stacked(paths.values())])
    far = [at for one in drawn.values() for (at, _), ray in zip(one, rays, strict=True) if not ray]
    found = [np.zeros((0, 3)) if scans[i].positions is None else scans[i].positions for i in kept]
    box, unit = box_around(near, stacked([*far, *found])), unit_of(stacked([near, *found]))
    steps = [(_title(scans[i]), _traces(scene, scans[i], costs[i], drawn[i], unit)) for i in kept]
    size = 0.6 if crowded else 1.0
    path = points(joined(paths.values()), unit)
    first = [scatter("truth, all scans", "lines", **path, line={"color": FAINT, "width": 3}, hoverinfo="skip")]
    last = scatter(
        "sensors", **points(sites, unit), text=_names(scene), hoverinfo="text",
        marker={"symbol": "triangle-up", "size": 11, "color": GREY},
    )  # fmt: skip
    data = [*(first if len(paths) else []), *_styles(scene, size), last]
    steps = within_budget(steps, BUDGET // share)
    return sliding({"data": data, "layout": plan(box, unit)}, steps, first=len(data) - 1 - len(steps[0][1])), len(steps)


def _names(scene: Scene) -> list[str]:
    return [escape(sensor.name or f"sensor {s + 1}") for s, sensor in enumerate(scene.sensors)]


def _title(scan: ScanAssociation) -> str:
    time = "" if scan.time is None else f", t = {moment(scan.time)}"
    return f"scan {scan.scan}{time}: {len(scan.targets)} targets, {scan.false_alarms} false alarms"


def _styles(scene: Scene, size: float) -> list[Dicts]:
    """What changes from scan to scan, in the order of `_traces`."""
    thin = {"width": 1}
    styles = [
        scatter("truth", marker={"symbol": "cross-thin", "size": 15 * size, "line": {"width": 2, "color": BLACK}}),
        scatter("95 % ellipses", "lines", line={**thin, "color": GREY, "dash": "dot"}, hoverinfo="skip"),
        scatter("association", "lines", line={**thin, "color": BLACK}, hoverinfo="skip"),
    ]
    if any(isinstance(sensor, BearingSensor) for sensor in scene.sensors):
        styles.append(scatter("bearings", "lines", line={**thin, "color": SKY}, hoverinfo="skip"))
    for s, sensor in enumerate(scene.sensors):
        marker = {"symbol": _SYMBOLS[s % len(_SYMBOLS)], "size": (15 - 2 * (s % 3)) * size, "color": colour(s)}
        styles.append(scatter(sensor.name or f"sensor {s + 1}", marker={**marker, "line": {"width": 2}}))
    lost = {"symbol": "x-thin", "size": 8 * size, "line": {"width": 1.5, "color": GREY}}
    styles += [
        scatter("false alarms", marker=lost),
        scatter("targets found", marker={"size": 7 * size, "color": BLACK}),
    ]
    return [{"hoverinfo": "text", **style} for style in styles]


def _traces(
    scene: Scene, scan: ScanAssociation, costs: Array, drawn: Sequence[tuple[Array, Array]], unit: Unit
) -> list[Dicts]:
    aligned = scene.scan(scan.scan).aligned(scene.sensors)
    standing = scene.at(aligned.time).sensors
    found = np.zeros((0, 3)) if scan.positions is None else scan.positions
    spread = np.zeros((0, 3, 3)) if scan.covariances is None else scan.covariances
    known = aligned.truth_ids is not None and aligned.truth_positions is not None
    ids = aligned.truth_ids.tolist() if known and aligned.truth_ids is not None else []
    truth = stacked([] if aligned.truth_positions is None else [aligned.truth_positions])
    outline = np.stack(ellipses(found, spread, 0.95), axis=1)
    traces = [
        {**points(truth, unit), "hovertext": [f"truth, target id {one}" for one in ids]},
        points(outline, unit),
    ]
    links: list[Array] = []
    bearings: list[Array] = []
    measured, lost, told = [], [], []
    for s, (sensor, name, (at, label)) in enumerate(zip(standing, _names(scene), drawn, strict=True)):
        owner = None if aligned.sources is None else aligned.sources[s].tolist()
        texts = [f"{name} no. {i + 1}: {_whose(t)}{_truly(owner, i)}" for i, t in enumerate(label.tolist())]
        kept, ray = label >= 0, isinstance(sensor, BearingSensor)
        links += [np.stack([start, found[t]]) for start, t in zip(at[kept], label[kept], strict=True)]
        bearings += [np.stack([sensor.position, end]) for end in at] if ray else []
        measured.append({**points(at[kept], unit), "hovertext": [texts[i] for i in np.flatnonzero(kept)]})
        lost.append(at[~kept])
        told += [texts[i] for i in np.flatnonzero(~kept)]
    traces.append(points(joined(links), unit))
    if any(isinstance(sensor, BearingSensor) for sensor in standing):
        traces.append(points(joined(bearings), unit))
    hovers = _hovers(scene, scan, costs, found, spread)
    # the target has moved between measurements with times of their own: what is between them is no error
    if aligned.times is None:
        _add_residuals(hovers, standing, _names(scene), aligned.measurements, scan.targets, found)
    false = {**points(stacked(lost), unit), "hovertext": told}
    return [*traces, *measured, false, {**points(found, unit), "hovertext": ["<br>".join(one) for one in hovers]}]


def _whose(target: int) -> str:
    return "declared a false alarm" if target < 0 else f"target {target + 1}"


def _truly(owner: Sequence[int] | None, i: int) -> str:
    if owner is None:
        return ""
    return "<br>in truth " + ("a false alarm" if owner[i] < 0 else f"of target id {owner[i]}")


def _hovers(scene: Scene, scan: ScanAssociation, costs: Array, found: Array, spread: Array) -> list[list[str]]:
    """Lines of each target: tuple, cost, probability, position."""
    sigma = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    degrees = None if scene.origin is None or not len(found) else np.degrees(geodetic(found, scene.origin)[:, :2])
    hovers = []
    for t in range(len(found)):
        row = ", ".join(map(str, scan.targets[t].tolist()))
        lines = [f"<b>target {t + 1}</b>, tuple ({row})", f"cost {costs[t]:.5g}"]
        if scan.probabilities is not None:
            low, middle, high = (100.0 * scan.probabilities[t]).tolist()
            lines.append(f"probability {middle:.3g} % ({low:.3g} to {high:.3g} %)")
        lines += [f"{axis} {found[t, i]:,.1f} \u00b1 {sigma[t, i]:.3g} m" for i, axis in enumerate("xyz")]
        if degrees is not None:
            lines.append(f"{degrees[t, 0]:.5f}\u00b0, {degrees[t, 1]:.5f}\u00b0")
        hovers.append(lines)
    return hovers


def _add_residuals(
    hovers: list[list[str]],
    sensors: Sequence[Sensor],
    names: Sequence[str],
    measurements: Sequence[Array],
    targets: Array,
    found: Array,
) -> None:
    """Add what each sensor measured less what the position found makes expect, with its standard deviations."""
    for s, sensor in enumerate(sensors):
        part = sensor.position_part
        seen = np.flatnonzero(targets[:, s]) if len(found) else np.zeros(0, dtype=int)
        if not len(seen):
            continue
        z = measurements[s][targets[seen, s] - 1, : part.dim]
        rest = part.residual(z, part.measure(found[seen]))
        sigma = np.sqrt(np.diagonal(part.covariance))
        for t, row in zip(seen.tolist(), rest, strict=True):
            shown = [
                f"{name} {np.degrees(value):.3g}\u00b0, {value / one:.2g} \u03c3" if name in ANGLES
                else f"{name} {value:.3g} m, {value / one:.2g} \u03c3"
                for name, value, one in zip(part.components, row.tolist(), sigma, strict=False)
            ]  # fmt: skip
            hovers[t] += [f"{names[s]} no. {targets[t, s]}: {shown[0]}", *(f"\u00a0\u00a0{one}" for one in shown[1:])]
