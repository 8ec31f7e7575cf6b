"""Every reader of files: a valid file for it, and what it does with one. For fuzzing.py, which spoils them."""

import contextlib
import io
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Room:
    """A kind of file: a valid one, and what reads it.

    Attributes
    ----------
    name : str
    kind : str
        How it is spoiled: "npz", "text", "sqlite" or "bytes".
    make : callable
        Writes valid files into a folder; returns those to be spoiled.
    read : callable
        Reads the file, and uses it.
    """

    name: str
    kind: str
    make: Callable[[Path], list[Path]]
    read: Callable[[Path], object]


def _scenes(folder: Path) -> list[Path]:
    from assoc.simulation import simulate

    simulate("three-radar", 1, scans=2).save(folder / "radars.npz")
    simulate("bearing-only", 2, scans=2).save(folder / "bearings.npz")
    return [folder / "radars.npz", folder / "bearings.npz"]


def _problems(folder: Path) -> list[Path]:
    from tests.oracles import small_problems

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


def _asterix(folder: Path) -> list[Path]:
    """Plots of two radars in blocks, and the same in the packets of a capture."""
    from assoc.integrations.asterix import write_plots
    from assoc.simulation import simulate_recording
    from tests.integrations.captures import ipv4, pcap, udp

    recording = simulate_recording("rotating-radar", 1, duration=30.0).recording
    blocks = []
    for radar in (1, 2):
        write_plots(folder / "plots.ast", recording, (1, radar))
        blocks.append((folder / "plots.ast").read_bytes())
    (folder / "plots.ast").write_bytes(b"".join(blocks))
    (folder / "plots.pcap").write_bytes(pcap([ipv4(udp(block)) for block in blocks], 101))
    return [folder / "plots.ast", folder / "plots.pcap"]


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
    """A finished study; its file is spoiled in place."""
    from tests.oracles import small_problems

    next(iter(small_problems(1, seed=3, dummy=True))).save(folder / "p.npz")
    command = [sys.executable, "-m", "assoc.sweep", str(folder / "p.npz"), "--solver", "aco"]
    command += ["--grid", "alpha=1,2", "ants=2,3", "--repeats", "2", "-o", str(folder / "study")]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    return [folder / "study"]


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
    from assoc.recordings.flights.reports import read_flight_reports

    read_flight_reports(str(path), {})


def _use_plots(path: Path) -> None:
    from assoc.recordings import read_plots

    read_plots(path)


def _use_asterix(path: Path) -> None:
    from assoc.integrations.asterix import read_asterix, read_records

    read_records(path)
    read_asterix(path)


def _refused_in_one_line(main: Callable[[list[str]], int], words: list[str]) -> None:
    """Run a program that has nothing to work on: it reads its configuration and complains, and nothing else happens."""
    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(io.StringIO()):
        code = main(words)
    if code not in (2, 3) or said.getvalue().count("\n") != 1:
        raise AssertionError(f"exit code {code}: {said.getvalue()[-200:]!r}")


def _use_solver_config(path: Path) -> None:
    from assoc.solve import main

    _refused_in_one_line(main, ["missing.npz", "--config", str(path)])


def _use_design(path: Path) -> None:
    from assoc.sweep import main

    _refused_in_one_line(main, ["--config", str(path), "-o", "nowhere"])


def _use_study(path: Path) -> None:
    from assoc.sweeps.frame import load

    load(path)


ROOMS = [
    Room("scene.npz", "npz", _scenes, _use_scene),
    Room("problem.npz", "npz", _problems, _use_problem),
    Room("tracks.csv", "text", _tracks, _use_tracks),
    Room("plots.csv", "text", _plots, _use_plots),
    Room("plots.ast", "bytes", _asterix, _use_asterix),
    Room("solve.toml", "text", _solver_config, _use_solver_config),
    Room("design.toml", "text", _design, _use_design),
    Room("study", "sqlite", _study, _use_study),
]
