"""Spoiled files for every reader and program: refused by one line, or read; nothing else may happen.

    python -m tests.reliability.fuzzing --count 20000 --processes 2 --seed 1      (make fuzz)

Each case spoils a valid file at random (mutations.py) and gives it to its reader in a child process that may
take 5 s and 1 GB more than it has. A case is a fault if the reader raises anything but an `AssocError` of one line,
is late, runs out of memory, executes a pickle, or takes the process with it. What is read without complaint is
used, too: a problem is solved, a scene's first scan associated.
"""

import argparse
import multiprocessing
import os
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from assoc.errors import AssocError, AssocWarning, InfeasibleError
from tests.reliability.mutations import MARKER, spoil
from tests.reliability.readers import ROOMS, Room
from tests.reliability.results import add_ends, report

SECONDS = 5
MEMORY = 1 << 30


class LateError(Exception):
    """The reader took too long."""


def _late(*_: object) -> None:
    raise LateError(f"longer than {SECONDS} s")


def prepare(folder: Path) -> dict[str, list[Path]]:
    """Write valid files of all rooms."""
    made = {}
    for room in ROOMS:
        (folder / room.name).mkdir()
        made[room.name] = room.make(folder / room.name)
    return made


def run_case(seed: int, number: int, made: dict[str, list[Path]], folder: Path) -> str | None:
    """Spoil one file and read it in this process; what went wrong, or None."""
    rng = np.random.default_rng([seed, number])
    room = ROOMS[number % len(ROOMS)]
    source = made[room.name][int(rng.integers(len(made[room.name])))]
    if source.is_dir():
        path = folder / "study"
        _spoil_study(rng, source, path)
    else:
        path = folder / f"case{source.suffix}"
        path.write_bytes(spoil(rng, source.read_bytes(), room.kind))
    fault = judge(room, path)
    return None if fault is None else f"{room.name}: {fault}"


def _spoil_study(rng: np.random.Generator, source: Path, path: Path) -> None:
    """Copy a study and spoil its file."""
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(source, path)
    chosen = path / "study.sqlite"
    chosen.write_bytes(spoil(rng, chosen.read_bytes(), "sqlite"))


def judge(room: Room, path: Path) -> str | None:
    """Read a file; what went wrong, or None."""
    signal.signal(signal.SIGALRM, _late)
    signal.setitimer(signal.ITIMER_REAL, SECONDS * 4)
    started = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", AssocWarning)  # spoiled costs may earn one, rightly
            room.read(path)
    except AssocError as error:
        if "\n" in str(error) or not str(error):
            return f"complains in several lines: {str(error)[:80]!r}"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        own = [frame for frame in traceback.extract_tb(error.__traceback__) if "/assoc/" in frame.filename]
        where = own[-1] if own else last
        return f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}: {str(error)[:100]}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    # processor time: the machine may be busy with other things
    if (seconds := time.process_time() - started) > SECONDS:
        return f"takes {seconds:.1f} s"
    if Path(MARKER).exists():
        os.rmdir(MARKER)
        return "executes a pickle"
    return None


def limit_memory() -> None:
    """Let this process take ``MEMORY`` more than it has."""
    with open("/proc/self/statm", encoding="ascii") as file:
        size = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))


def warm_up(made: dict[str, list[Path]]) -> None:
    """Read all valid files, which must be accepted: imports and compilation are done after that."""
    for room in ROOMS:
        for path in made[room.name]:
            try:
                room.read(path)
            except InfeasibleError:
                pass


def _child(seed: int, numbers: range, made: dict[str, list[Path]], folder: str, results: Any) -> None:
    os.makedirs(folder, exist_ok=True)
    os.chdir(folder)
    warm_up(made)
    limit_memory()
    for number in numbers:
        results.send((number, "begins"))
        fault = run_case(seed, number, made, Path(folder))
        results.send((number, fault))
    results.send((None, None))


def campaign(seed: int, numbers: range, made: dict[str, list[Path]], folder: Path) -> Iterator[tuple[int, str | None]]:
    """Run cases in a child process, a new one where the old one died; yields case and fault."""
    context = multiprocessing.get_context("spawn")
    left = numbers
    while left:
        receive, send = context.Pipe(duplex=False)
        child = context.Process(target=_child, args=(seed, left, made, str(folder), send), daemon=True)
        child.start()
        send.close()
        at = left[0]
        try:
            while True:
                number, text = receive.recv()
                if number is None:
                    child.join()
                    return
                if text == "begins":
                    at = number
                else:
                    yield number, text
        except EOFError:
            child.join()
            yield at, f"{ROOMS[at % len(ROOMS)].name}: the process died (exit code {child.exitcode})"
            left = range(at + 1, left.stop)
        finally:
            child.kill()


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if there were faults."""
    parser = argparse.ArgumentParser(description="Spoiled files for every reader and program.")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0)
    add_ends(parser)
    chosen = parser.parse_args(arguments)
    started = time.perf_counter()
    kinds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        made = prepare(folder)
        tried = Counter[str]()
        lock = threading.Lock()

        def work(part: int) -> None:
            share = -(-chosen.count // chosen.processes)
            begin = chosen.start + part * share
            numbers = range(begin, min(begin + share, chosen.start + chosen.count))
            for number, fault in campaign(chosen.seed, numbers, made, folder / f"work{part}"):
                with lock:
                    tried[ROOMS[number % len(ROOMS)].name] += 1
                    _note(kinds, fault, f"seed {chosen.seed} case {number}")
                if time.perf_counter() - started > 60.0 * chosen.minutes:
                    break

        threads = [threading.Thread(target=work, args=(part,)) for part in range(chosen.processes)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return report("fuzzing", chosen.publish, Counter(files=tried.total()) + tried, kinds)


def _note(kinds: Counter[str], fault: str | None, label: str) -> None:
    if fault is None:
        return
    kind = ":".join(fault.split(":")[:3])
    kinds[kind] += 1
    if kinds[kind] <= 3:
        print(f"{label}: {fault}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
