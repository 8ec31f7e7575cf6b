"""Spoiled files for every reader and program: refused by one line, or read; nothing else may happen.

    python -m tests.reliability.fuzzing --count 20000 --processes 2 --seed 1      (make fuzz)

Each case spoils a valid file at random (mutations.py) and gives it to its reader in a child process that may
take 5 s and 1 GB more than it has. A case is a fault if the reader raises anything but an `AssocError` of one line,
is late, runs out of memory, executes a pickle, or takes the process with it. What is read without complaint is
used, too: a problem is solved, a scene's first scan associated. A smaller part runs as programs.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from assoc.errors import AssocError, AssocWarning, InfeasibleError
from tests.reliability.mutations import MARKER, bombs, spoil

SECONDS = 5
MEMORY = 1 << 30


@dataclass(frozen=True)
class Room:
    """A kind of file: a valid one, and what reads it.

    Attributes
    ----------
    name : str
    kind : str
        How it is spoiled: "npz", "text" or "log".
    make : callable
        Writes valid files into a folder; returns those to be spoiled.
    read : callable
        Reads the file, and uses it.
    """

    name: str
    kind: str
    make: Callable[[Path], list[Path]]
    read: Callable[[Path], object]


# --- valid files --------------------------------------------------------------------------------------------


def _scenes(folder: Path) -> list[Path]:
    from assoc.simulation import simulate

    simulate("three-radar", 1, scans=2).save(folder / "radars.npz")
    simulate("bearing-only", 2, scans=2).save(folder / "bearings.npz")
    return [folder / "radars.npz", folder / "bearings.npz"]


def _problems(folder: Path) -> list[Path]:
    from experiments.common.oracles import small_problems

    paths = []
    for number, problem in enumerate(small_problems(6, seed=3)):
        paths.append(folder / f"problem{number}.npz")
        problem.save(paths[-1])
    return paths


def _tracks(folder: Path) -> list[Path]:
    rows = ["time,icao24,lat,lon,geoaltitude,velocity"]
    rows += [f"{t},{name},{45 + 0.01 * t / 10},{7 + 0.01 * i},{1000.0 + i},200" for t in range(0, 50, 10)
             for i, name in enumerate(("abc123", "00ff00"))]  # fmt: skip
    (folder / "tracks.csv").write_text("\n".join(rows) + "\n")
    return [folder / "tracks.csv"]


def _plots(folder: Path) -> list[Path]:
    rows = ["time,range_nmi,bearing,mode3,altitude"]
    rows += [f"12:{t:02d}:0{t % 10},{20 + t},{(t * 37) % 360},{1200 + t},{300 + t}" for t in range(30)]
    (folder / "plots.csv").write_text("\n".join(rows) + "\n")
    return [folder / "plots.csv"]


def _solver_config(folder: Path) -> list[Path]:
    text = 'solver = "aco"\nseed = 3\ntime-limit = 2.5\nscans = "0:1"\ngate_probability = 0.99\nmax_tuples = 1000\n'
    text += '[aco]\nants = 4\nmode = "mmas"\nalpha = 1.5\n[milp]\nbackend = "highs"\n'
    (folder / "solve.toml").write_text(text)
    return [folder / "solve.toml"]


def _design(folder: Path) -> list[Path]:
    text = 'solver = "aco"\nrepeats = 2\nseed = 1\n[aco]\nalpha = [1.0, 2.0]\nants = [5, 15]\nrho = [0.1, 0.9]\n'
    (folder / "design.toml").write_text(text)
    return [folder / "design.toml"]


def _study(folder: Path) -> list[Path]:
    """A finished study; the log and the manifest are spoiled in place."""
    from experiments.common.oracles import small_problems

    next(iter(small_problems(1, seed=3, dummy=True))).save(folder / "p.npz")
    command = [sys.executable, "-m", "assoc.sweep", str(folder / "p.npz"), "--solver", "aco"]
    command += ["--grid", "alpha=1,2", "ants=2,3", "--repeats", "2", "-o", str(folder / "study")]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return [folder / "study"]


# --- readers ------------------------------------------------------------------------------------------------


def _use_scene(path: Path) -> None:
    from assoc.association import associate
    from assoc.scene import Scene

    scene = Scene.load(path)
    if sum(len(z) for z in scene.measurements[0]) < 200 and len(scene.sensors) < 6:
        one = Scene(scene.sensors, scene.times[:1], scene.measurements[:1], region=scene.region)
        associate(one, "greedy", gating={"max_tuples": 20_000}, time_limit=1.0)


def _use_problem(path: Path) -> None:
    from assoc.problem import AssignmentProblem
    from assoc.solvers.assign import assign

    problem = AssignmentProblem.load(path)
    assert np.isfinite(assign(problem, "exact", time_limit=2.0).cost)


def _use_tracks(path: Path) -> None:
    from assoc.simulation.flight_reports import read_flight_reports

    read_flight_reports(str(path), {})


def _use_plots(path: Path) -> None:
    from assoc.recordings import read_plots

    read_plots(path)


def _use_solver_config(path: Path) -> None:
    from assoc import solve

    solve._solver({"solver": None, "config": str(path)})


def _use_design(path: Path) -> None:
    from assoc.sweep import main

    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(io.StringIO()):
        # without a file to solve the program reads its design and complains; nothing else may happen
        code = main(["--config", str(path), "-o", "nowhere"])
    if code not in (2, 3) or said.getvalue().count("\n") != 1:
        raise AssertionError(f"exit code {code}: {said.getvalue()[-200:]!r}")


def _use_study(path: Path) -> None:
    from assoc.sweeps.frame import load

    load(path)


ROOMS = [
    Room("scene.npz", "npz", _scenes, _use_scene),
    Room("problem.npz", "npz", _problems, _use_problem),
    Room("tracks.csv", "text", _tracks, _use_tracks),
    Room("plots.csv", "text", _plots, _use_plots),
    Room("solve.toml", "text", _solver_config, _use_solver_config),
    Room("design.toml", "text", _design, _use_design),
    Room("study", "log", _study, _use_study),
]


# --- one case -----------------------------------------------------------------------------------------------


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
    """Copy a study and spoil its log or its manifest."""
    shutil.rmtree(path, ignore_errors=True)
    shutil.copytree(source, path)
    inside = sorted(one for one in path.iterdir() if one.stat().st_size)
    chosen = inside[int(rng.integers(len(inside)))]
    chosen.write_bytes(spoil(rng, chosen.read_bytes(), "log" if chosen.suffix != ".json" else "text"))


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


# --- programs -----------------------------------------------------------------------------------------------

_PROGRAMS: dict[str, list[list[str]]] = {
    "scene.npz": [["assoc.solve", "{}", "--solver", "greedy", "--scans", "0", "--json", "out.json"]],
    "problem.npz": [["assoc.solve", "{}", "--time-limit", "2", "--csv", "out.csv"]],
    "tracks.csv": [["assoc.simulate", "from-tracks", "{}", "-o", "out.npz"]],
    "solve.toml": [["assoc.solve", "valid.npz", "--config", "{}"]],
    "study": [["assoc.sweep", "--summary", "{}"]],
}


def run_program(seed: int, number: int, made: dict[str, list[Path]], folder: Path) -> str | None:
    """Spoil one file and give it to its program; what went wrong, or None."""
    rng = np.random.default_rng([seed, number, 1])
    name = list(_PROGRAMS)[number % len(_PROGRAMS)]
    room = next(one for one in ROOMS if one.name == name)
    source = made[name][int(rng.integers(len(made[name])))]
    path = folder / f"program{source.suffix}"
    if source.is_dir():
        _spoil_study(rng, source, path)
    else:
        path.write_bytes(spoil(rng, source.read_bytes(), room.kind))
    shutil.copy(made["problem.npz"][0], folder / "valid.npz")
    words = _PROGRAMS[name][int(rng.integers(len(_PROGRAMS[name])))]
    command = [sys.executable, "-W", "error", "-m", *[word.format(path) for word in words]]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=60, cwd=folder, preexec_fn=_program_memory
        )
    except subprocess.TimeoutExpired:
        return f"{words[0]} on {room.name}: longer than 60 s"
    label = f"{words[0]} on {room.name} (seed {seed}, program {number})"
    if done.returncode not in (0, 2, 3) or "Traceback" in done.stderr:
        return f"{label}: exit code {done.returncode}, {done.stderr[-300:]!r}"
    if done.returncode and len(done.stderr.strip().splitlines()) != 1:
        return f"{label}: complains in several lines: {done.stderr[-300:]!r}"
    if (folder / MARKER).exists():
        os.rmdir(folder / MARKER)
        return f"{label}: executes a pickle"
    if done.returncode and any(folder.glob(".*.part")):
        return f"{label}: leaves a half-written file"
    return None


def _program_memory() -> None:
    # what numba, BLAS and their threads map is about 2 GB of address space, next to nothing of it used
    resource.setrlimit(resource.RLIMIT_AS, (4 * MEMORY, resource.RLIM_INFINITY))


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if there were faults."""
    parser = argparse.ArgumentParser(description="Spoiled files for every reader and program.")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--programs", type=int, default=200, help="cases that run as programs")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--start", type=int, default=0)
    chosen = parser.parse_args(arguments)
    started = time.perf_counter()
    kinds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = prepare(folder)
        tried = 0
        for room in (ROOMS[0], ROOMS[1]):
            for path in bombs(folder, made[room.name][0].read_bytes()):
                tried += 1
                fault = _bomb(room, path)
                if fault:
                    kinds[f"{room.name}: {path.name}: {fault}"] += 1
        import threading

        lock = threading.Lock()

        def work(part: int) -> None:
            nonlocal tried
            share = -(-chosen.count // chosen.processes)
            begin = chosen.start + part * share
            numbers = range(begin, min(begin + share, chosen.start + chosen.count))
            for number, fault in campaign(chosen.seed, numbers, made, folder / f"work{part}"):
                with lock:
                    tried += 1
                    _note(kinds, fault, f"seed {chosen.seed} case {number}")
            own = folder / f"programs{part}"
            own.mkdir()
            for number in range(part, chosen.programs, chosen.processes):
                fault = run_program(chosen.seed, number, made, own)
                with lock:
                    tried += 1
                    _note(kinds, fault, f"seed {chosen.seed} program {number}")

        threads = [threading.Thread(target=work, args=(part,)) for part in range(chosen.processes)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    print(f"{tried} cases, {time.perf_counter() - started:.0f} s: {sum(kinds.values())} faults")
    for kind, count in kinds.most_common():
        print(f"{count:6d} {kind}")
    return 1 if kinds else 0


def _note(kinds: Counter[str], fault: str | None, label: str) -> None:
    if fault is None:
        return
    kind = ":".join(fault.split(":")[:3])
    kinds[kind] += 1
    if kinds[kind] <= 3:
        print(f"{label}: {fault}", flush=True)


def _bomb(room: Room, path: Path) -> str | None:
    """Read a bomb in a process of its own, and see what memory that took."""
    context = multiprocessing.get_context("spawn")
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=_read_bomb, args=(room.name, str(path), send))
    child.start()
    send.close()
    try:
        return str(receive.recv()) or None
    except EOFError:
        return f"the process died (exit code {child.exitcode})"
    finally:
        child.join()


def _read_bomb(name: str, path: str, send: Any) -> None:
    room = next(one for one in ROOMS if one.name == name)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    text = judge(room, Path(path))
    taken = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    send.send(text or (f"takes {taken >> 20} MB" if taken > MEMORY else ""))


if __name__ == "__main__":
    sys.exit(main())
