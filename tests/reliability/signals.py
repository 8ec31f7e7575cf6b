"""Ctrl-C at random moments while kernels are compiled: what ends how, and when.

    python -m tests.reliability.signals [--count N] [--seed N]

Each trial starts with an empty cache of kernels. A program must end with its own code and line, the library by
KeyboardInterrupt, and no process that they started may be left some seconds later.
"""

import argparse
import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from assoc.simulation import simulate
from assoc.sweeps import load
from tests.listening import listens
from tests.told import told

# what other libraries print when they are interrupted while they are imported is theirs: the text says when it is done
IMPORTED = "imported"
IMPORT = f"""
import assoc
assoc.load, assoc.build_problem, assoc.assign, assoc.warm_up
open({IMPORTED!r}, "w").close()
"""
LIBRARY = IMPORT + "for scan in range(4):\n    assoc.assign(assoc.build_problem(assoc.load({!r}), scan), {!r})\n"
WAYS = {
    "solve exact": ["-m", "assoc.solve", "ghosts.npz", "--json", "o.json"],
    "solve aco, interpreted": ["-m", "assoc.solve", "radars.npz", "--solver", "aco", "--json", "o.json"],
    "solve, 2 processes": ["-m", "assoc.solve", "radars.npz", "--jobs", "2", "--json", "o.json"],
    "track": ["-m", "assoc.track", "radars.npz", "-o", "t.csv"],
    "sweep": ["-m", "assoc.sweep", "radars.npz", "--solver", "aco", "-o", "study"],
    "library, exact": ["-c", LIBRARY.format("ghosts.npz", "exact")],
    "library, warm_up": ["-c", IMPORT + "assoc.warm_up()"],
}
RADAR_SCANS = 12
OUTPUTS = ("o.json", "t.csv", "study/study.sqlite")
# a program that compiles is to end within a second, and the library after a step of the compiler; on a busy machine
PATIENCE = 120.0
BUSY = 4.0


class Trial(NamedTuple):
    """How one ended: "as it should" or what was wrong, and the seconds from the signal to the end, by two clocks."""

    verdict: str
    seconds: float
    cpu: float = 0.0


def folder_of_scenes(folder: Path) -> Path:
    """Write the scenes that all trials use."""
    simulate("three-radar", 2, scans=RADAR_SCANS).save(folder / "radars.npz")
    simulate("bearing-only", 2, targets=12, scans=4).save(folder / "ghosts.npz")
    return folder


def trial(way: str, after: float, scenes: Path, rng: random.Random) -> Trial:
    """Send Ctrl-C after so many seconds; "done before" if the work was done by then."""
    library = way.startswith("library")
    ended = _cpu_of_ended()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        for scene in scenes.glob("*.npz"):
            os.symlink(scene, Path(name) / scene.name)
        interpret = "1" if "interpreted" in way or "library" in way else rng.choice("01")
        environment = {**os.environ, "NUMBA_CACHE_DIR": f"{name}/kernels", "ASSOC_INTERPRET": interpret}
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        process = subprocess.Popen([sys.executable, *WAYS[way]], cwd=name, env=environment, text=True, **pipes)
        time.sleep(after)
        if process.poll() is not None:
            process.communicate()
            return Trial("done before" if process.returncode == 0 else "failed before", 0.0)
        used = _cpu_with(f"{name}/kernels")
        begun = (Path(name) / IMPORTED).exists() if library else listens(process.pid)
        process.send_signal(signal.SIGINT)
        sent, clock = time.monotonic(), time.time()
        try:
            _, errors = process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
            return Trial("lost", PATIENCE)
        seconds, cpu = time.monotonic() - sent, _cpu_of_ended() - ended - used
        # a helper that is starting ends when it has started
        time.sleep(BUSY)
        left = _end_processes_with(f"{name}/kernels")
        lines = told(errors).splitlines()
        if not lines and not library:
            # all was written, Python was at its end, and the helper may finish its kernel
            written = [path.stat().st_mtime for one in OUTPUTS if (path := Path(name) / one).exists()]
            whole = way != "sweep" or (written and len(load(f"{name}/study")) == RADAR_SCANS)
            if written and whole and max(written) < clock:
                return Trial("done before", seconds, cpu)
        if process.returncode == 0:
            return Trial("done before" if library and cpu < 1.0 else "exit 0 after the signal", seconds, cpu)
        if library:
            # Python itself says 1 where the interrupt came in code that it did not compile from a text
            good = process.returncode in (1, -signal.SIGINT, 130) and lines[-1:] == ["KeyboardInterrupt"]
            good = good and (not begun or alone(errors, lines))
        else:
            good = process.returncode == 130 and len(lines) == 1 and ": interrupted" in lines[0]
            # before the program has begun
            good |= process.returncode == -signal.SIGINT and not lines
            good |= not begun and lines[-1:] == ["KeyboardInterrupt"]
        if not good:
            return Trial(f"exit {process.returncode}: {' | '.join(lines[-3:])[:200]}", seconds, cpu)
        return Trial(f"left: {left}" if left else "as it should", seconds, cpu)


def _cpu_of_ended() -> float:
    """Processor seconds of all that this process started, and they in turn, and that ended."""
    times = os.times()
    return times.children_user + times.children_system


def _cpu_with(text: str) -> float:
    """Processor seconds of the processes in whose environment a text is."""
    ticks = 0
    for path in _processes_with(text):
        with contextlib.suppress(OSError):
            fields = (path / "stat").read_text().rpartition(")")[2].split()
            ticks += sum(map(int, fields[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


def _end_processes_with(text: str) -> list[str]:
    """End the processes in whose environment a text is; returns their command lines."""
    found = []
    for path in _processes_with(text):
        with contextlib.suppress(OSError):
            found.append(" ".join((path / "cmdline").read_text().split("\0"))[-150:])
            os.kill(int(path.name), signal.SIGKILL)
    return found


def alone(errors: str, lines: list[str]) -> bool:
    """Whether nothing but one interrupt is told; where it came in an except clause, Python tells what that handled.

    As in functools.singledispatch, which looks for the classes of arguments when it does not find them.
    """
    tracebacks = errors.count("Traceback") - errors.count("During handling of the above exception")
    return tracebacks == lines.count("KeyboardInterrupt") == 1 and "Exception ignored" not in errors


def _processes_with(text: str) -> Iterator[Path]:
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if text.encode() in (path / "environ").read_bytes():
                yield path


def main() -> int:
    """Run the program; exit code 1 if one trial ended otherwise."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ways", default=";".join(WAYS))
    parser.add_argument("--latest", type=float, default=25.0)
    options = parser.parse_args()
    # a job in the background ignores Ctrl-C, and so would what it starts
    signal.signal(signal.SIGINT, signal.default_int_handler)
    ways = options.ways.split(";")
    rng = random.Random(options.seed)
    found: dict[str, list[Trial]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        scenes = folder_of_scenes(Path(name))
        for number in range(options.count):
            way = ways[number % len(ways)]
            found[way].append(trial(way, rng.uniform(0.2, options.latest), scenes, rng))
            print(number, way, *found[way][-1], flush=True)
    for way, trials in found.items():
        late = sorted(one.seconds for one in trials if one.verdict == "as it should") or [0.0]
        counts = dict(Counter(one.verdict for one in trials))
        print(f"{way}: {counts}; seconds: median {late[len(late) // 2]:.2f}, longest {late[-1]:.2f}")
    good = {"as it should", "done before"}
    return int(any(one.verdict not in good for trials in found.values() for one in trials))


if __name__ == "__main__":
    sys.exit(main())
