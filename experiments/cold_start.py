"""How long a user waits after an installation: commands with an empty folder of compiled kernels, each several times.

    python -m experiments.cold_start [--wheel PYTHON] [--runs N] [--json FILE] [--publish]        (make bench-cold)

Each run starts from an empty cache of its own, as a fresh clone does, and is followed by a second one with the cache
that the first left. ``--wheel`` names the Python of an environment where a wheel with compiled kernels is installed
(``make dist``): the same commands there, with an empty cache. Wall seconds say what a user feels on two idle cores;
processor seconds are of the command and the processes that it started.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from assoc.simulation import simulate
from experiments.common.claims import Claim, save_json
from experiments.common.results import result_file

COMMANDS = {
    "solve, exact, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "exact"],
    "solve, aco, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "aco"],
    "track, three radars": ["-m", "assoc.track", "easy.npz", "-o", "tracks.csv"],
    "solve, exact, one scan of 20 ghosts": ["-m", "assoc.solve", "hard.npz"],
    "warm_up": ["-c", "import assoc; assoc.warm_up()"],
}


GOALS = dict(zip(COMMANDS, (15.0, 15.0, 15.0, 20.0, 45.0), strict=True))
"""Seconds of wall time on a fresh clone that a user is to wait at the most."""


def measure(python: str, words: list[str], folder: Path, cache: Path) -> tuple[float, float]:
    """Run a command; wall and processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    if python != sys.executable:
        # the environment's own package, not this clone's
        environment.pop("PYTHONPATH", None)
    subprocess.run([python, *words], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def runs_of(python: str, words: list[str], folder: Path, runs: int) -> dict[str, list[tuple[float, float]]]:
    """Wall and processor seconds of each run, with an empty cache and with that of the run before it."""
    found: dict[str, list[tuple[float, float]]] = {"cold": [], "warm": []}
    for _ in range(runs):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
            for seconds in found.values():
                seconds.append(measure(python, words, folder, Path(cache)))
    return found


def experiment(runs: int, wheel: str | None) -> list[Claim]:
    """Measure all commands; prints a row for each."""
    claims = []
    print(f"{'median seconds of ' + str(runs):38s} {'wall':>8} {'cpu':>8}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulate("three-radar", seed=0).save(folder / "easy.npz")
        simulate("bearing-only", seed=0, targets=20, scans=1).save(folder / "hard.npz")
        for label, words in COMMANDS.items():
            clone = runs_of(sys.executable, words, folder, runs)
            ways = {"fresh clone": clone["cold"], "again": clone["warm"]}
            if wheel is not None:
                ways["wheel"] = runs_of(wheel, words, folder, runs)["cold"]
            print(label)
            for way, pairs in ways.items():
                for kind, values in zip(("wall", "cpu"), zip(*pairs, strict=True), strict=True):
                    most = GOALS[label] if (way, kind) == ("fresh clone", "wall") else None
                    claims.append(_claim(f"{label}: {way}, {kind}", values, most))
                print(f"    {way:34s} {claims[-2].ours:8.1f} {claims[-1].ours:8.1f}", flush=True)
    return claims


def _claim(quantity: str, values: Sequence[float], most: float | None) -> Claim:
    middle = statistics.median(values)
    band, holds, source = (None, None, "") if most is None else ((None, most), middle <= most, "goal chosen by us")
    return Claim(quantity, "s", ours=middle, interval=(min(values), max(values)), band=band, holds=holds, source=source)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and keep the seconds; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.cold_start", description="What a user waits for after an installation."
    )
    parser.add_argument("--wheel", metavar="PYTHON", help="Python of an environment with an installed wheel")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs of each command (default 3)")
    parser.add_argument("--json", metavar="FILE", help="write the seconds here")
    parser.add_argument("--publish", action="store_true", help="write the result file that the pages are made from")
    chosen = parser.parse_args(arguments)
    if chosen.runs < 1:
        parser.error("--runs must be at least 1")
    claims = experiment(chosen.runs, chosen.wheel)
    for path in (chosen.json, str(result_file("cold_start")) if chosen.publish else None):
        if path:
            save_json(path, claims, "cold_start", 0, " ".join((__doc__ or "").split()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
