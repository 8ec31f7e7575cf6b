"""How long a user waits after an installation: commands with an empty folder of compiled kernels, each several times.

Each run starts from an empty cache of its own, as a fresh clone does, and is followed by a second, warm one with the
cache that the first left. ``--wheel`` names a wheel, such as one with compiled kernels (``make dist``): it is installed
with its dependencies into an empty environment (this needs a network, or an index that pip knows; nothing comes from
pip's cache), and the same commands run there. Commands run at a terminal, where a row is
printed as each scan is finished. Wall seconds say what a user feels on two idle cores; processor seconds are of the
command and the processes that it started.
"""

import argparse
import os
import pty
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from assoc.simulation import simulate
from experiments.common.claims import GOAL, Claim
from experiments.common.command import add_files, report, whole
from experiments.installation import install, wheel_of

COMMANDS = {
    "solve, exact, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "exact"],
    "solve, aco, three radars": ["-m", "assoc.solve", "easy.npz", "--solver", "aco"],
    "track, three radars": ["-m", "assoc.track", "easy.npz", "-o", "tracks.csv"],
    "solve, exact, one scan of 20 ghosts": ["-m", "assoc.solve", "hard.npz"],
    "warm_up": ["-c", "import assoc; assoc.warm_up()"],
}


GOALS = dict(zip(COMMANDS, (15.0, 15.0, 15.0, 20.0, 45.0), strict=True))
"""Seconds of wall time on a fresh clone that a user is to wait at the most."""
FIRST = 5.0
"""Seconds until the first of several scans."""
# the row of scan 0, without the colours
_ROW = re.compile(rb"[\r\n]\s*0\s+\d")
_COLOURS = re.compile(rb"\x1b\[[0-9;?]*[a-zA-Z]")


class Seconds(NamedTuple):
    """Of one run."""

    wall: float
    cpu: float
    first: float
    """Until the row of the first scan was there; NaN if there is none."""


def measure(python: str, words: list[str], folder: Path, cache: Path) -> Seconds:
    """Run a command at a terminal.

    Raises RuntimeError: It fails.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "COLUMNS": "80"}
    if python != sys.executable:
        # the environment's own package, not this clone's
        environment.pop("PYTHONPATH", None)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ours, theirs = pty.openpty()
    started, first, said = time.perf_counter(), float("nan"), b""
    with subprocess.Popen([python, *words], cwd=folder, env=environment, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        try:
            while piece := os.read(ours, 65536):
                said += piece
                if first != first and _ROW.search(_COLOURS.sub(b"", said)):
                    first = time.perf_counter() - started
        except OSError:
            # how Linux says that the other end is closed
            pass
    wall = time.perf_counter() - started
    os.close(ours)
    if process.returncode:
        raise RuntimeError(f"{' '.join(words)}: exit code {process.returncode}: {said[-500:].decode(errors='replace')}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Seconds(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, first)


def runs_of(python: str, words: list[str], folder: Path, runs: int) -> dict[str, list[Seconds]]:
    """Each run with an empty cache and with that of the run before it."""
    found: dict[str, list[Seconds]] = {"cold": [], "warm": []}
    for _ in range(runs):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as cache:
            for seconds in found.values():
                seconds.append(measure(python, words, folder, Path(cache)))
    return found


def experiment(runs: int, wheel: Path | None) -> list[Claim]:
    """Measure all commands; prints which is measured."""
    claims: list[Claim] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        installed = None if wheel is None else install(wheel, folder / "env")
        simulate("three-radar", seed=0).save(folder / "easy.npz")
        simulate("bearing-only", seed=0, targets=20, scans=1).save(folder / "hard.npz")
        for label, words in COMMANDS.items():
            clone = runs_of(sys.executable, words, folder, runs)
            ways = {"fresh clone": clone["cold"], "again": clone["warm"]}
            if installed is not None:
                shipped = runs_of(installed, words, folder, runs)
                ways |= {"wheel": shipped["cold"], "wheel, again": shipped["warm"]}
            print(label, flush=True)
            for way, measured in ways.items():
                goals = (GOALS[label], None, FIRST) if way == "fresh clone" else (None, None, None)
                for kind, values, most in zip(Seconds._fields, zip(*measured, strict=True), goals, strict=True):
                    # one scan is its own first
                    if kind != "first" or (values[0] == values[0] and "one scan" not in label):
                        words_of = {"wall": "wall", "cpu": "cpu", "first": "first scan, wall"}[kind]
                        claims.append(_claim(f"{label}: {way}, {words_of}", values, most))
    return claims


def _claim(quantity: str, values: Sequence[float], most: float | None) -> Claim:
    middle = statistics.median(values)
    band, source = (None, "") if most is None else ((None, most), GOAL)
    return Claim(quantity, "s", ours=middle, interval=(min(values), max(values)), band=band, source=source)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and keep the seconds; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.cold_start", description="What a user waits for after an installation."
    )
    parser.add_argument("--wheel", type=Path, metavar="FILE", help="a wheel: installed, and measured as well")
    parser.add_argument("--runs", type=whole(1), default=3, metavar="N", help="runs of each command (default 3)")
    add_files(parser, "cold_start")
    chosen = parser.parse_args(arguments)
    claims = experiment(chosen.runs, chosen.wheel and wheel_of(parser, chosen.wheel))
    report(chosen, claims, "cold_start", __doc__)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
