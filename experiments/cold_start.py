"""How long a user waits after an installation: commands with an empty folder of compiled kernels, each several times.

    python -m experiments.cold_start [--runs N] [--json FILE]        (make bench-cold)

Each run starts from an empty cache of its own and is followed by a second one with the cache that the first left. Wall
seconds say what a user feels on two idle cores; processor seconds are of the command and the processes that it started.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from assoc._files.output import write_text
from assoc.simulation import simulate

COMMANDS = {
    "solve, exact, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "exact"],
    "solve, aco, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "aco"],
    "track, three radars": ["-m", "assoc.track", "easy.npz", "-o", "tracks.csv"],
    "solve, exact, one scan of 20 ghosts": ["-m", "assoc.solve", "hard.npz"],
    "warm_up": ["-c", "import assoc; assoc.warm_up()"],
}


def measure(words: list[str], folder: Path, cache: Path) -> tuple[float, float]:
    """Run a command; wall and processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    subprocess.run([sys.executable, *words], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each command."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.cold_start", description="What a user waits for after an installation."
    )
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs of each command (default 3)")
    parser.add_argument("--json", metavar="FILE", help="write the seconds of all runs here")
    chosen = parser.parse_args(arguments)
    if chosen.runs < 1:
        parser.error("--runs must be at least 1")
    rows: dict[str, dict[str, list[float]]] = {}
    print(f"{'median seconds of ' + str(chosen.runs):36s} cold: wall    cpu   again: wall    cpu")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulate("three-radar", seed=0).save(folder / "easy.npz")
        simulate("bearing-only", seed=0, targets=20, scans=1).save(folder / "hard.npz")
        for label, words in COMMANDS.items():
            seconds: dict[str, list[float]] = {"cold_wall": [], "cold_cpu": [], "again_wall": [], "again_cpu": []}
            for _ in range(chosen.runs):
                with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
                    for when in ("cold", "again"):
                        wall, cpu = measure(words, folder, Path(cache))
                        seconds[f"{when}_wall"].append(wall)
                        seconds[f"{when}_cpu"].append(cpu)
            rows[label] = seconds
            middle = [statistics.median(values) for values in seconds.values()]
            print(f"{label:36s} {middle[0]:10.1f} {middle[1]:6.1f} {middle[2]:13.1f} {middle[3]:6.1f}", flush=True)
    if chosen.json:
        write_text(chosen.json, json.dumps({"format": "assoc.cold_start", "version": 1, "seconds": rows}, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
