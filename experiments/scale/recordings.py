"""How fast recordings of one radar are tracked, and in how much memory.

500 aircraft at a time within 250 km, each for half an hour, turns of 4 s, P_d 0.9, 5 % false plots, altitudes and
codes: a CSV file, tracked by the program `assoc track` in a process of its own. Plots a second of processor time, all
of it: reading, grouping, tracking, writing. A first run on a short recording compiles modules and kernels. Memory at
the peak is that of the process; that of the longer recording says whether it grows.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import main

GOAL = "chosen by us"
AIRCRAFT, TURN, LIFE, REACH = 500, 4.0, 1_800.0, 250e3
SIZES = (100_000, 500_000, 5_000_000)
GOALS = {"nearest-neighbour": 20_000.0, "mht": 10_000.0}
WORDS = ("--range-noise", "30", "--bearing-noise", "0.1", "--detection-probability", "0.9", "--false-alarms", "25")


def write(path: Path, plots: int, rng: np.random.Generator) -> None:
    """Write a recording of about so many plots, turn by turn."""
    turns = round(plots / (0.95 * AIRCRAFT))
    count = round(AIRCRAFT * (1.0 + turns * TURN / LIFE))
    born = np.sort(rng.uniform(-LIFE, turns * TURN, count))
    middle, course = rng.uniform(-0.6 * REACH, 0.6 * REACH, (count, 2)), rng.uniform(0.0, 2 * np.pi, count)
    velocity = rng.uniform(120.0, 250.0, count)[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
    codes, levels = 1 + np.arange(count) % 4095, rng.integers(50, 400, count)
    with path.open("w") as file:
        file.write("time,range_m,bearing_deg,mode3,altitude\n")
        for turn in range(turns):
            begin = turn * TURN
            living = np.flatnonzero((born <= begin) & (born + LIFE > begin))
            living = living[rng.random(len(living)) < 0.9]
            false = rng.poisson(0.05 * AIRCRAFT)
            places = middle[living] + velocity[living] * (begin - born[living] - LIFE / 2)[:, None]
            ranges = np.append(np.hypot(*places.T), rng.uniform(1e3, REACH, false))
            bearings = np.append(np.arctan2(places[:, 0], places[:, 1]), rng.uniform(0.0, 2 * np.pi, false))
            ranges += rng.normal(0.0, 30.0, len(ranges))
            degrees = np.degrees(bearings + rng.normal(0.0, np.radians(0.1), len(bearings))) % 360.0
            known = np.append(codes[living], np.zeros(false, int))
            heights = [*map(str, levels[living].tolist()), *[""] * false]
            times = begin + degrees / 360.0 * TURN
            rows = [row for row in np.argsort(times).tolist() if 1e3 < ranges[row] < REACH]
            file.writelines(
                f"{times[row]:.3f},{ranges[row]:.1f},{degrees[row]:.4f},{known[row]},{heights[row]}\n" for row in rows
            )


class Run(NamedTuple):
    """A run of the program."""

    plots: int
    processor: float
    """Seconds, of the process and its own."""
    wall: float
    peak: float
    """MB."""


def track(recording: Path, tracker: str) -> Run:
    """Track a recording in a process of its own."""
    words = [sys.executable, "-m", "assoc.track", str(recording), "--tracker", tracker, "-q", *WORDS]
    words += ["-o", str(recording.with_suffix(".tracks.csv"))]
    # as usual, Python keeps modules that it has compiled
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    begin = time.perf_counter()
    with subprocess.Popen(words, env=environment) as process:
        _, code, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(code)
    if process.returncode:
        raise RuntimeError(f"{tracker}, {recording.name}: exit code {process.returncode}")
    with recording.open() as file:
        plots = sum(1 for _ in file) - 1
    return Run(plots, used.ru_utime + used.ru_stime, time.perf_counter() - begin, used.ru_maxrss / 1e3)


def lengths(files: Mapping[int, Path]) -> list[Claim]:
    """Plots a second and memory of each tracker, length by length; a run of the shortest before them compiles."""
    claims = []
    for tracker, goal in GOALS.items():
        track(files[min(files)], tracker)
        for size, path in files.items():
            found = track(path, tracker)
            words, rate = f"{tracker}, {size:,} plots", found.plots / found.processor
            print(f"{words}: {found}", flush=True)
            claims += [
                Claim(f"{words}: plots a second", "1/s", ours=rate, band=(goal, None), source=GOAL),
                Claim(f"{words}: memory", "MB", ours=found.peak, band=(None, 1_000.0), source=GOAL),
            ]
    return claims


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Write recordings of growing length, and track them."""
    with tempfile.TemporaryDirectory() as folder:
        files = {plots: Path(folder) / f"{plots}.csv" for plots in ((10_000,) if quick else SIZES)}
        for plots, path in files.items():
            write(path, plots, rng)
        return lengths(files)


if __name__ == "__main__":
    raise SystemExit(main("scale.recordings", experiment, __doc__))
