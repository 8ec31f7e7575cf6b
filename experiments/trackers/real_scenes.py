"""Scenes with something not as trackers are told, or as real sensors are, row by row.

Twelve targets, 40 scans of 4 s, three 3-D radars, default settings unless a row says otherwise.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.scene import Scene
from assoc.sensors import Radar2D, Radar3D, Sensor
from assoc.simulation import simulate as made
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking.filter_choice import make_filter
from experiments.trackers.close_targets import REGION, SETTINGS, Setting, radars, simulate

TARGETS, SCANS, INTERVAL = 12, 40, 4.0
TIMES = INTERVAL * np.arange(SCANS)
SEPARATE = SETTINGS["separate"]


class Case(NamedTuple):
    """One seed of a row.

    declared: Its measurements and the sensors that trackers are told of.
    known: The same with sensors as they are; left out where there is nothing to be known.
    options: Of every tracker and the oracle.
    level: Whether tracks are judged by their horizontal places alone.
    """

    declared: Scene
    known: Scene | None = None
    options: Mapping[str, Any] = {}
    level: bool = False


Make = Callable[[int], Case]


def short_radars(seed: int, detection_probability: float = 0.9) -> Case:
    """Six radars that reach 17 km each; all know it."""
    return Case(simulate(SEPARATE, seed, sensors=_short(17e3, detection_probability)))


def farther_seen_less(seed: int) -> Case:
    """Six radars that detect 95 % of what is near, half at 17 km; they are said to detect 90 % up to 40 km."""
    told = _short(40e3, 0.9)
    full = simulate(SEPARATE, seed, sensors=[replace(radar, detection_probability=_NEAR) for radar in told])
    rng = np.random.default_rng([seed, 1])
    kept = [
        [(who < 0) | (rng.random(len(z)) * _NEAR < _at_range(z[:, 0])) for z, who in zip(*scan, strict=True)]
        for scan in zip(full.measurements, full.truth.sources, strict=True)
    ]
    return Case(replace(_left(full, kept), sensors=told))


_NEAR = 0.95


def _at_range(away: Array) -> Array:
    """Detection probabilities at distances, metres."""
    return np.asarray(_NEAR / (1.0 + np.exp((away - 17e3) / 2e3)))


def _short(reach: float, detection_probability: float) -> list[Sensor]:
    """Six radars that reach so far."""
    noise = {"range_noise": 50.0, "angle_noise": 1e-3}
    found: list[Sensor] = []
    for place in on_circle(np.zeros(3), 16e3, 6):
        name = f"radar at {place[0] / 1e3:.0f}, {place[1] / 1e3:.0f} km"
        full = _radar(place, name, detection_probability=detection_probability, **noise)
        found.append(replace(full, field_of_view=np.concatenate([[[0.0, reach]], full.field_of_view[1:]])))
    return found


def _radar(place: Array, name: str, **more: Any) -> Radar3D:
    """The usual radar at a place, but for what is given."""
    usual = {"range_noise": 80.0, "angle_noise": 1.6e-3, "detection_probability": 0.9, "false_alarm_rate": 10.0}
    return radar_over(REGION, place, name=name, **usual | more)


def _left(scene: Scene, kept: Sequence[Sequence[Array]]) -> Scene:
    """The scene with these measurements alone, bool (n_s,) each."""

    def left(arrays: Any) -> list[list[Array]]:
        return [[a[k] for a, k in zip(scan, keep, strict=True)] for scan, keep in zip(arrays, kept, strict=True)]

    return _with(scene, left(scene.measurements), left(scene.truth.sources))


def _with(scene: Scene, measurements: Any, sources: Any) -> Scene:
    """The scene with these measurements, each of one of these targets."""
    return replace(scene, measurements=measurements, truth=replace(scene.truth, sources=sources))


def _all_seen(paths: Array, rng: np.random.Generator) -> Case:
    """Targets that are there all the time (K, T, 3), seen by the usual radars."""
    ids = [np.arange(paths.shape[1])] * SCANS
    return Case(observe(radars(SEPARATE), TIMES, ids, list(paths), rng, region=REGION))


def wind_farm(seed: int) -> Case:
    """Each radar has ten returns a scan from a patch of 3 x 3 km, 200 m high."""
    rng, scene = np.random.default_rng([seed, 1]), simulate(SEPARATE, seed)
    low = np.append(rng.uniform(-15e3, 12e3, 2), 0.0)
    measurements, sources = [], []
    for scan, source in zip(scene.measurements, scene.truth.sources, strict=True):
        more = [
            sensor.measure(rng.uniform(low, low + [3e3, 3e3, 200.0], (10, 3)))
            + rng.standard_normal((10, sensor.dim)) @ np.linalg.cholesky(sensor.covariance).T
            for sensor in scene.sensors
        ]
        measurements.append([np.concatenate(both) for both in zip(scan, more, strict=True)])
        sources.append([np.append(own, np.full(10, -1)) for own in source])
    return Case(_with(scene, measurements, sources))


def misdeclared(declared: Setting, true: Setting) -> Make:
    """Scenes of true sensors, of which trackers are told something else."""

    def row(seed: int) -> Case:
        known = simulate(true, seed)
        return Case(replace(known, sensors=radars(declared)), known)

    return row


def agile(seed: int) -> Case:
    """Targets of 250 m/s that now and then turn with 8 g for 2 to 6 s."""
    rng, fine, turn = np.random.default_rng(seed), 0.1, 8 * 9.81 / 250.0
    steps = round(SCANS * INTERVAL / fine)
    rate = np.zeros((steps, TARGETS))
    for target in range(TARGETS):
        k = 0
        while k < steps:
            k += round(rng.uniform(8.0, 30.0) / fine)
            length = round(rng.uniform(2.0, 6.0) / fine)
            rate[k : k + length, target] = turn * rng.choice([-1.0, 1.0])
            k += length
    heading = rng.uniform(-np.pi, np.pi, TARGETS) + np.cumsum(rate, axis=0) * fine
    velocity = 250.0 * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    path = np.cumsum(velocity, axis=0) * fine
    middle = rng.uniform([-12e3, -12e3, 0.0], [12e3, 12e3, 1.0], (TARGETS, 3))
    middle[:, 2] = rng.permutation(np.linspace(1e3, 11e3, TARGETS))
    return _all_seen((path - path.mean(axis=0) + middle)[:: round(INTERVAL / fine)], rng)


def one_planar(seed: int, declared: float = 100.0) -> Case:
    """Low targets under one radar without heights, 100 false alarms a scan, of which so many are declared."""
    scene, region = simulate(SEPARATE, seed), np.array([*REGION[:2], [0.0, 2e3]])
    radar = replace(_planar(scene.sensors[0]), false_alarm_rate=100.0, name="radar")
    rng = np.random.default_rng([seed, 1])
    paths = [np.column_stack([at[:, :2], np.full(len(at), 1e3)]) for at in scene.truth.positions]
    scene = observe([radar], scene.times, scene.truth.target_ids, paths, rng, region=region)
    told = [replace(radar, false_alarm_rate=declared)]
    filter = make_filter("imm-cv", told, pace=INTERVAL, region=region)
    return Case(replace(scene, sensors=told), options={"filter": filter}, level=True)


def _planar(radar: Sensor) -> Radar2D:
    """The radar without elevations."""
    return Radar2D(
        position=radar.position, noise=radar.covariance[:2, :2], detection_probability=radar.detection_probability,
        false_alarm_rate=radar.false_alarm_rate, field_of_view=radar.field_of_view[:2], name=radar.name,
    )  # fmt: skip


def flat_radars(seed: int) -> Case:
    """Three radars without elevations, and the filter of the programs."""
    sensors: list[Sensor] = [_planar(radar) for radar in radars(SEPARATE)]
    filter = make_filter("imm-cv", sensors, pace=INTERVAL, region=REGION)
    return Case(simulate(SEPARATE, seed, sensors=sensors), options={"filter": filter}, level=True)


TURNING: Mapping[str, Any] = {"turns": "4,5,5.5", "interval": INTERVAL, "duration": SCANS * INTERVAL}
NOISY, LOUD = (160.0,) * 3, (240.0,) * 3
ADAPTING = "multi-sensor, adapting"
"""What the programs run."""


def _separate(**values: Any) -> Setting:
    return SEPARATE._replace(**values)


ROWS: dict[str, Make] = {
    "six radars of 17 km": short_radars,
    "six radars of 17 km, P_d 0.6": lambda seed: short_radars(seed, 0.6),
    "six radars, P_d falling with range": farther_seen_less,
    "three 2-D radars": flat_radars,
    "radars turning in 4, 5 and 5.5 s": lambda seed: Case(made("rotating-radars", seed, **TURNING)),
    "P_d 0.6, declared 0.9": misdeclared(SEPARATE, _separate(detection_probability=0.6)),
    "noise twice the declared": misdeclared(SEPARATE, _separate(noise=NOISY)),
    "noise three times the declared": misdeclared(SEPARATE, _separate(noise=LOUD)),
    "formations, noise twice the declared": misdeclared(SETTINGS["formations"], Setting("formations", NOISY)),
    "8 g": agile,
    "wind farm": wind_farm,
    "one 2-D radar, 100 false alarms": one_planar,
    "one 2-D radar, 100 false alarms, declared 20": lambda seed: one_planar(seed, 20.0),
    "formations": lambda seed: Case(simulate(SETTINGS["formations"], seed)),
    "all as declared": lambda seed: Case(simulate(SEPARATE, seed)),
    "P_d 0.6, rightly declared": lambda seed: Case(simulate(_separate(detection_probability=0.6), seed)),
    "P_d 0.9, declared 0.6": misdeclared(_separate(detection_probability=0.6), SEPARATE),
    "five times the false alarms": misdeclared(SEPARATE, _separate(false_alarms=50.0)),
}
