"""Plots as they come: the time of a step with 500 aircraft under three turning radars.

What `assoc live` does with its defaults (tracker multi-sensor) and the antennas' turns of 4, 5 and 5.5 s,
plots taken in every half second: 500 aircraft (scenario `rotating-radars`), 60 s of plots, the first 10 s not counted.
CPU times of a step, from the plot that ends an interval to the picture, and wall times beside them, which on a busy
machine hold what others do.
"""

import gc
from functools import partial

import numpy as np

from assoc import simulation
from assoc._cli.track.plot_lines import replayed
from assoc._types import Array
from assoc.tracking import LiveTracker, MultiSensorTracker
from assoc.tracking.filter_choice import manoeuvre_noise, two_speeds
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.common.measuring import clocked

TURNS, INTERVAL, AIRCRAFT, DURATION, SETTLED = (4.0, 5.0, 5.5), 0.5, 500, 60.0, 10.0
GOAL_MS = 100.0
"""For the 99th percentile of a step, milliseconds."""


def steps(aircraft: int, duration: float, seed: int) -> tuple[Array, int]:
    """CPU and wall seconds of each step (n, 2), and how many confirmed tracks there are at the end."""
    turns = ",".join(f"{turn:g}" for turn in TURNS)
    scene = simulation.simulate("rotating-radars", seed, aircraft=aircraft, turns=turns, duration=duration)

    def make() -> MultiSensorTracker:
        filter = two_speeds(manoeuvre_noise(min(TURNS)))
        return MultiSensorTracker(scene.sensors, filter, region=scene.region, adapt=True)

    tracker = LiveTracker(scene, make, interval=INTERVAL, turns=TURNS, tell=lambda line: None)
    tracker.warm_up()
    gc.freeze()  # as the program does
    found, tracks = [], 0
    for plot in replayed(scene, 0.0):
        pictures, wall, cpu = clocked(partial(tracker.take, *plot))
        if pictures:
            found += [np.array([cpu, wall]) / len(pictures)] * len(pictures)
            tracks = len(pictures[-1].tracks)
    return np.array(found), tracks


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Measure the steps."""
    aircraft, duration = (30, 20.0) if quick else (AIRCRAFT, DURATION)
    seconds, tracks = steps(aircraft, duration, int(rng.integers(1_000)))
    settled = 1e3 * seconds[int(SETTLED / INTERVAL) :]
    middle, high = np.quantile(settled, [0.5, 0.99], axis=0).tolist()
    label = f"{aircraft} aircraft"
    return [
        Claim(f"{label}: steps", "", ours=len(settled)),
        Claim(f"{label}: CPU time of a step, median", "ms", ours=middle[0]),
        with_goal(f"goal: {label}: CPU time of a step, p99", "ms", high[0], most=GOAL_MS),
        Claim(f"{label}: wall time of a step, median", "ms", ours=middle[1]),
        Claim(f"{label}: wall time of a step, p99", "ms", ours=high[1]),
        Claim(f"{label}: confirmed tracks at the end", "", ours=tracks),
    ]


if __name__ == "__main__":
    raise SystemExit(main("trackers.live", experiment, __doc__))
