"""Biased radars: how exactly registration finds the biases, and what trackers gain by it.

Three radars (50 m, 0.057 degrees, P_d 0.9) whose ranges and azimuths are off by up to 300 m and 0.3 degrees, each with
signs of its own. First the errors of the biases found from about 1,000 plots, then GOSPA of the multi-sensor tracker
over 60 scans: without biases, with them, with a scene that was registered, with registration online. On simulated
flights (--seeds of them, 8), and on recorded trajectories (scenario from-tracks, half as many) if a file is given. No
truth is used but to judge.
"""

from argparse import Namespace
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.registration import register, with_biases
from assoc.scene import Scene
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS
from experiments.common.claims import Claim
from experiments.common.command import add_recording, main
from experiments.trackers.judging import distances, goal, mean_claim, through

SIZES = ((0.0, 0.0), (100.0, 0.1), (200.0, 0.2), (300.0, 0.3))
"""Biases of range and azimuth, metres and degrees."""
PLOTS, SCANS, SEEDS = 1_000, 60, 8
RANGE_GOAL, AZIMUTH_GOAL, GOSPA_GOAL = 10.0, 0.01, 1.02
AIRCRAFT, INTERVAL, REGION = 30, 4.0, np.array([[-75e3, 75e3], [-75e3, 75e3], [0.0, 12e3]])

Simulate = Callable[[int], Scene]


def flights(seed: int, aircraft: int = AIRCRAFT, scans: int = SCANS) -> Scene:
    """Aircraft (thirty) in straight flight, seen by three radars of 50 m and 0.057 degrees."""
    rng = np.random.default_rng(seed)
    times = INTERVAL * np.arange(scans)
    start = rng.uniform([-45e3, -45e3, 3e3], [45e3, 45e3, 11e3], (aircraft, 3))
    heading, speed = rng.uniform(-np.pi, np.pi, aircraft), rng.uniform(120.0, 250.0, aircraft)
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(aircraft)], axis=1)
    paths = start[None] + (times - times.mean())[:, None, None] * velocity[None]
    sensors = [
        radar_over(
            REGION, place, range_noise=50.0, angle_noise=1e-3, detection_probability=0.9, false_alarm_rate=5.0,
            name=f"radar {number}",
        )
        for number, place in enumerate(on_circle(np.zeros(3), 60e3, 3), start=1)
    ]  # fmt: skip
    return observe(sensors, times, [np.arange(aircraft)] * scans, list(paths), rng, region=REGION)


def biased(scene: Scene, size: tuple[float, float], seed: int) -> tuple[Scene, Array]:
    """The scene with biases of this size and random signs, and the biases (S, 2), metres and degrees."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (len(scene.sensors), 2))
    wrong = signs * np.array(size)
    return with_biases(scene, [{"range": bias[0], "azimuth": np.radians(bias[1])} for bias in wrong]), wrong


def first_plots(scene: Scene, count: int) -> Scene:
    """The first scans that hold so many plots together."""
    totals = np.cumsum([sum(len(z) for z in scan) for scan in scene.measurements])
    scans = min(int(np.searchsorted(totals, count)) + 1, scene.num_scans)
    return Scene(scene.sensors, scene.times[:scans], scene.measurements[:scans], scene.region)


def errors(scene: Scene, wrong: Array) -> Array:
    """Errors of the biases found in a scene, (S, 2), metres and degrees."""
    found = register(scene)
    own = [found.of(s) for s in range(len(scene.sensors))]
    return np.array([[bias["range"], np.degrees(bias["azimuth"])] for bias in own]) - wrong


def gospa(scene: Scene, truth: Scene, registration: str | None = None) -> float:
    """Mean GOSPA of the multi-sensor tracker, metres."""
    done = through(TRACKERS["multi-sensor"].for_scene(scene, registration=registration), scene)
    return float(distances(truth, done.tracks).mean())


def measured(label: str, simulate: Simulate, seeds: Sequence[int]) -> list[Claim]:
    """Errors of the biases from about 1,000 plots, then GOSPA as a multiple of that without biases."""
    scenes = [simulate(seed) for seed in seeds]
    plain = np.array([gospa(scene, scene) for scene in scenes])
    claims = [mean_claim(f"{label}, no biases: GOSPA", "m", plain)]
    for size in SIZES:
        start = f"{label}, {size[0]:g} m, {size[1]:g} deg"
        cases = [biased(scene, size, seed) for scene, seed in zip(scenes, seeds, strict=True)]
        off = np.array([errors(first_plots(scene, PLOTS), wrong) for scene, wrong in cases])
        for i, (name, unit, most) in enumerate((("range", "m", RANGE_GOAL), ("azimuth", "deg", AZIMUTH_GOAL))):
            each = np.sqrt((off[..., i] ** 2).mean(axis=1))
            claims.append(mean_claim(f"{start}: RMS error of {name}", unit, each))
            if size == SIZES[-1]:
                claims.append(goal(f"{start}: RMS error of {name}", unit, each, most))
        pairs = list(zip(scenes, (scene for scene, _ in cases), strict=True))
        for name, values in {
            "with biases": [gospa(scene, truth) for truth, scene in pairs],
            "registered": [gospa(register(scene).correct(scene), truth) for truth, scene in pairs],
            "online": [gospa(scene, truth, "online") for truth, scene in pairs],
        }.items():
            what, ratio = f"{start}, {name}: GOSPA / without biases", np.array(values) / plain
            claims.append(mean_claim(what, "", ratio))
            # the largest biases are to be found, and where there are none nothing is to be spoiled
            if name != "with biases" and size in (SIZES[0], SIZES[-1]):
                claims.append(goal(what, "", ratio, GOSPA_GOAL))
    return claims


def experiment(chosen: Namespace) -> list[Claim]:
    """Simulated flights, and the file's."""
    kinds: dict[str, Simulate] = {"simulated": flights}
    if chosen.file is not None:
        kinds["recorded"] = lambda seed: simulation.simulate("from-tracks", seed, file=chosen.file, scans=SCANS)
    claims = []
    for label, simulate in kinds.items():
        scenes = chosen.seeds if label == "simulated" else chosen.seeds // 2
        seeds = [chosen.seed + k for k in range(2 if chosen.quick else max(2, scenes))]
        claims += measured(label, simulate, seeds)
    return claims


program = partial(
    main, "trackers.biases", experiment, __doc__, seeds=(SEEDS, "scenes of flights"), options=[add_recording],
    said=" Cutoff of GOSPA 500 m. {seeds} scenes of flights, half as many (at least 2) recorded.",
)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
