"""Programs that are ended at any moment: signals, and `kill -9` of live tracking, which then goes on.

    python -m tests.reliability.ended --signals 300 --restarts 100 --seed 1 [--publish NAME]

Programs run in children forked from a process that has imported and loaded all, so that a try takes some tenths of a
second. A signal must end a program with its exit code and one line, or find it done, and leave no half-written file.
Live tracking gets its lines anew from some seconds before its last row, as a source that repeats; in the end it must
have written each row of a run that nothing ended.
"""

import argparse
import io
import os
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd

from assoc.simulation import simulate
from tests.listening import listens
from tests.reliability.results import add_ends, report

WORDS = {
    "solve": "scene.npz --solver aco --mode paper --json o.json",
    "solve exact": "scene.npz --solver exact --report o.html",
    "sweep": "scene.npz --solver aco --grid mode=paper alpha=1,2 ants=40 --repeats 20 -o study",
    "track": "scene.npz -o o.csv",
    "live": "radars.npz --turns 4,5,5.5 --replay 0 -o live.csv --state live.npz",
}
CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


def forked(name: str, words: Sequence[object], lines: bytes | None = None) -> tuple[int, Callable[[], tuple[int, str]]]:
    """Start ``assoc.NAME words`` as a child; its number, and what waits for its exit code and stderr."""
    given, said = tempfile.TemporaryFile(), tempfile.TemporaryFile()
    given.write(lines or b"")
    given.seek(0)
    child = os.fork()
    if child == 0:
        code = 99
        try:
            with open(os.devnull, "wb") as quiet:
                for number, file in enumerate((given, quiet, said)):
                    os.dup2(file.fileno(), number)
            sys.stdin, sys.stderr = open(0), open(2, "w", buffering=1)
            code = import_module(f"assoc.{name}").start([str(word) for word in words])
        finally:
            sys.stderr.flush()
            os._exit(code)

    def wait() -> tuple[int, str]:
        _, status = os.waitpid(child, 0)
        said.seek(0)
        return os.waitstatus_to_exitcode(status), said.read().decode(errors="replace")

    return child, wait


def try_signal(rng: np.random.Generator, name: str, seconds: float) -> str | None:
    """End a program at a random moment of its usual time; what was wrong."""
    number = signal.Signals(rng.choice([signal.SIGINT, signal.SIGTERM]))
    child, wait = forked(name.split()[0], WORDS[name].split())
    while not listens(child) and os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        time.sleep(0.001)
    time.sleep(float(rng.uniform(0.0, seconds)))
    os.kill(child, number)
    code, said = wait()
    last = said.rstrip().rpartition("\n")[2]
    if (
        code not in (0, CODES[number])
        or "Traceback" in said
        or (code and not last.startswith(f"assoc.{name.split()[0]}:"))
    ):
        return f"{name}: {number.name}: exit code {code}: {said[-200:]!r}"
    left = [str(path) for path in Path().glob(".*.part")]
    return f"{name}: left {left}" if left else None


def signals(rng: np.random.Generator, count: int, faults: Counter[str], counts: Counter[str], end: float) -> None:
    """End programs, in turn, by signals."""
    simulate("three-radar", 2, scans=6).save("scene.npz")
    simulate("rotating-radars", 5, aircraft=3, duration=20.0, false_alarms=1.0).save("radars.npz")
    usual = {}
    for name, words in WORDS.items():
        # in this process, which then has all loaded; and once as it is tried
        import_module(f"assoc.{name.split()[0]}").main(words.split())
        clear()
        started = time.perf_counter()
        code, said = forked(name.split()[0], words.split())[1]()
        usual[name] = time.perf_counter() - started
        assert code == 0, said
    for k in range(count):
        if time.monotonic() > end:
            break
        clear()
        name = [*WORDS][k % len(WORDS)]
        fault = try_signal(rng, name, usual[name])
        counts["signals"] += 1
        if fault:
            faults[fault[:60]] += 1
            print(f"try {k}: {fault}", flush=True)


def clear() -> None:
    """Remove what programs wrote."""
    for path in ("study/study.sqlite", "whole.csv", "live.csv", "live.npz", "o.json", "o.html", "o.csv"):
        Path(path).unlink(missing_ok=True)


def restarts(rng: np.random.Generator, count: int, faults: Counter[str], counts: Counter[str], end: float) -> None:
    """Kill live tracking, ten times in a session, and let it go on."""
    from assoc import live
    from assoc._cli.track.plot_lines import replayed

    # states are saved after each plot: a try need not wait
    live._EVERY = 0.0
    session = 0
    while counts["restarts"] < count and time.monotonic() < end:
        scene = simulate("rotating-radars", 100 + session, aircraft=3, duration=60.0, false_alarms=1.0)
        scene.save("live-scene.npz")
        clear()
        words = ["live-scene.npz", "--turns", "4,5,5.5", "-q", "-o"]
        lines = [",".join([p.sensor, repr(p.time), *map(repr, p.values)]) for p in replayed(scene, 0.0)]
        times = np.array([float(line.split(",")[1]) for line in lines])
        whole = forked("live", [*words, "whole.csv"], "\n".join(lines).encode())[1]()
        assert whole[0] == 0, whole
        begin = 0
        for _ in range(10):
            child, wait = forked("live", [*words, "live.csv", "--state", "live.npz"], "\n".join(lines[begin:]).encode())
            time.sleep(float(rng.uniform(0.0, 1.0)))
            os.kill(child, signal.SIGKILL)
            code, said = wait()
            counts["restarts"] += 1
            if code not in (0, -9):
                faults[f"live: exit code {code}"] += 1
                print(f"session {session}: exit code {code}: {said[-300:]}", flush=True)
            text = Path("live.csv").read_text() if Path("live.csv").exists() else ""
            rows = text[: text.rfind("\n") + 1].splitlines()[1:]
            last = max((float(row.split(",")[1]) for row in rows if row.count(",") > 3), default=0.0)
            begin = int(np.searchsorted(times, last - 8.0))
        code, said = forked("live", [*words, "live.csv", "--state", "live.npz"], "\n".join(lines[begin:]).encode())[1]()
        found, expected = (
            pd.read_csv(io.StringIO(Path(name).read_text())).drop_duplicates(["track_id", "time"])
            for name in ("live.csv", "whole.csv")
        )
        if code or found.isna().any(axis=None) or abs(len(found) - len(expected)) > 0.02 * len(expected):
            faults["live: other rows than without kills"] += 1
            print(
                f"session {session}: {code}, {len(found)} rows, {len(expected)} without kills: {said[-300:]}",
                flush=True,
            )
        session += 1


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if there were faults."""
    parser = argparse.ArgumentParser(description="Programs that are ended by signals and by kill -9.")
    parser.add_argument("--signals", type=int, default=300)
    parser.add_argument("--restarts", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    add_ends(parser)
    chosen = parser.parse_args(arguments)
    rng, faults, counts = np.random.default_rng(chosen.seed), Counter[str](), Counter[str]()
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            last = time.monotonic() + 60.0 * chosen.minutes
            signals(rng, chosen.signals, faults, counts, last)
            restarts(rng, chosen.restarts, faults, counts, last)
        finally:
            os.chdir(before)
    return report("ended", chosen.publish, counts, faults)


if __name__ == "__main__":
    sys.exit(main())
