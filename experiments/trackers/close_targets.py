"""Trackers where association is hard: formations, crossings, low P_d, many false alarms, mixed sensors.

Twelve targets, 40 scans of 4 s, default settings; GOSPA, OSPA(2) and HOTA with a cutoff of 500 m, identity switches a
scene and CPU time of a scan, beside an oracle that is told which measurement is whose. Seeds are --seed (200) and those
that follow, --seeds of them (20).
"""

from argparse import Namespace
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.scene import Scene
from assoc.sensors import BearingSensor, Sensor
from assoc.simulation.observation import observe
from assoc.simulation.radars import azimuth_interval, on_circle, padded_azimuth, radar_over
from assoc.simulation.scenarios.three_radar import REFERENCE_RANGE
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.judging import NAMES, compare

TARGETS, SCANS, INTERVAL = 12, 40, 4.0
REGION = np.array([[-30_000.0, 30_000.0], [-30_000.0, 30_000.0], [0.0, 12_000.0]])
_AROUND = 40_000.0
"""Distance of the sensors from the middle of the box, metres."""
_SHARE = 4
"""Targets in a formation."""


class Setting(NamedTuple):
    """One kind of scene.

    flight: "separate", "formations" or "crossings".
    noise: Standard deviation of the range of each radar, metres; its angles err as much across at 50 km.
    bearings: Sensors of azimuth alone (2 mrad) besides the radars.
    detection_probability, false_alarms: Of each sensor; the mean number of false alarms in a scan.
    """

    flight: str
    noise: tuple[float, ...] = (80.0, 80.0, 80.0)
    bearings: int = 0
    detection_probability: float = 0.9
    false_alarms: float = 10.0


UNEQUAL = (30.0, 80.0, 200.0)
SETTINGS = {
    "separate": Setting("separate"),
    "formations": Setting("formations"),
    "formations, unequal radars": Setting("formations", UNEQUAL),
    "formations, unequal radars, P_d 0.6": Setting("formations", UNEQUAL, detection_probability=0.6),
    "formations, 150 false alarms": Setting("formations", false_alarms=150.0),
    "crossings": Setting("crossings"),
    "crossings, P_d 0.6": Setting("crossings", detection_probability=0.6),
    "formations, 1 radar and 3 bearings": Setting("formations", (80.0,), bearings=3),
}


def simulate(setting: Setting, seed: int, scans: int = SCANS, sensors: Sequence[Sensor] | None = None) -> Scene:
    """Simulate a scene of this kind, or its flights under other sensors, with its truth."""
    rng = np.random.default_rng(seed)
    times = INTERVAL * np.arange(scans)
    middle, velocity = _FLIGHTS[setting.flight](rng)
    paths = middle[None] + (times - INTERVAL * (SCANS - 1) / 2.0)[:, None, None] * velocity[None]
    ids = [np.arange(TARGETS)] * scans
    sensors = radars(setting) if sensors is None else sensors
    return observe(sensors, times, ids, list(paths), rng, region=REGION, velocities=[velocity] * scans)


def radars(setting: Setting) -> list[Sensor]:
    """The radars of a kind of scene, then its bearing sensors."""
    each = {"detection_probability": setting.detection_probability, "false_alarm_rate": setting.false_alarms}
    radars = len(setting.noise)
    sensors: list[Sensor] = []
    for number, place in enumerate(on_circle(np.zeros(3), _AROUND, radars + setting.bearings), 1):
        if number <= radars:
            noise = setting.noise[number - 1]
            errors = {"range_noise": noise, "angle_noise": noise / REFERENCE_RANGE}
            sensors.append(radar_over(REGION, place, name=f"radar {number}", **errors, **each))
        else:
            view = np.array([padded_azimuth(azimuth_interval(place, REGION), 2e-3)])
            name = f"bearing sensor {number}"
            sensors.append(BearingSensor(position=place, noise=[2e-3], field_of_view=view, name=name, **each))
    return sensors


def _places(rng: np.random.Generator, count: int) -> Array:
    """Places at half time, far enough inside the box for the whole flight, metres (count, 3)."""
    return rng.uniform([-12_000.0, -12_000.0, 4_000.0], [12_000.0, 12_000.0, 10_000.0], (count, 3))


def level(heading: Array, speed: Array) -> Array:
    """Level velocities (n, 3) of these headings and speeds."""
    return np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(len(heading))], axis=1)


def _separate(rng: np.random.Generator) -> tuple[Array, Array]:
    # each on a height of its own, so that none come near each other
    places = _places(rng, TARGETS)
    places[:, 2] = rng.permutation(np.linspace(1_000.0, 11_000.0, TARGETS))
    return places, level(rng.uniform(-np.pi, np.pi, TARGETS), rng.uniform(150.0, 230.0, TARGETS))


def _formations(rng: np.random.Generator) -> tuple[Array, Array]:
    """Abreast, 200 to 500 m from one to the next, each formation on a height of its own."""
    groups = TARGETS // _SHARE
    leaders = _places(rng, groups)
    leaders[:, 2] = rng.permutation(np.linspace(3_000.0, 9_000.0, groups))
    heading, speed = rng.uniform(-np.pi, np.pi, groups), rng.uniform(150.0, 230.0, groups)
    aside = np.stack([-np.sin(heading), np.cos(heading), np.zeros(groups)], axis=1)
    steps = np.concatenate([np.zeros((groups, 1)), rng.uniform(200.0, 500.0, (groups, _SHARE - 1))], axis=1)
    offset = np.cumsum(steps, axis=1)[:, :, None] * aside[:, None]
    back = rng.uniform(-50.0, 50.0, (groups, _SHARE, 1)) * level(heading, np.ones(groups))[:, None]
    places = (leaders[:, None] + offset + back).reshape(-1, 3)
    return places, np.repeat(level(heading, speed), _SHARE, axis=0)


def _crossings(rng: np.random.Generator) -> tuple[Array, Array]:
    """Pairs that meet at half time, within 100 m, at 5 to 15 degrees."""
    pairs = TARGETS // 2
    places = np.repeat(_places(rng, pairs), 2, axis=0)
    places[:, 2] = np.repeat(rng.permutation(np.linspace(2_000.0, 10_000.0, pairs)), 2)
    places[:, :2] += rng.normal(0.0, 50.0, (TARGETS, 2))
    heading = np.repeat(rng.uniform(-np.pi, np.pi, pairs), 2)
    heading[1::2] += np.radians(rng.uniform(5.0, 15.0, pairs))
    return places, level(heading, np.repeat(rng.uniform(150.0, 230.0, pairs), 2))


_FLIGHTS = {"separate": _separate, "formations": _formations, "crossings": _crossings}


SEEDS, FIRST = 20, 200


def experiment(chosen: Namespace) -> list[Claim]:
    """Trackers of these names on all scenes."""
    claims: list[Claim] = []
    quick, seeds = chosen.quick, range(chosen.seed, chosen.seed + (2 if chosen.quick else chosen.seeds))
    for label, setting in list(SETTINGS.items())[: 2 if quick else None]:
        scenes = [simulate(setting, seed, 8 if quick else SCANS) for seed in seeds]
        claims += compare(label, chosen.names, scenes)
    return claims


if __name__ == "__main__":
    raise SystemExit(main(
        "trackers.close_targets", experiment, __doc__, only=NAMES, seeds=(SEEDS, "scenes of each kind"),
        said=" {seeds} scenes of each kind.", seed=FIRST,
    ))  # fmt: skip
