"""Every reader of files: a valid file for it, and what it does with one. For fuzzing.py, which spoils them."""

import contextlib
import io
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from assoc.errors import AssocError

KINDS = ("multi-sensor", "mht", "mht-hypothesis", "nearest-neighbour", "joint-probabilistic", "static")
"""Trackers whose saved states are spoiled."""
_TRACKERS: dict[int, Any] = {}


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


def _states(folder: Path) -> list[Path]:
    """Saved trackers, which learn, of every kind; the first letters of a name are the kind."""
    paths = []
    for number, kind in enumerate(KINDS):
        tracker, scene = _tracker(number)
        for k in range(2):
            tracker.step(float(scene.times[k]), scene.scan(k).measurements)
        paths.append(folder / f"{kind}.npz")
        tracker.save(paths[-1])
    return paths


def _tracker(number: int) -> tuple[Any, Any]:
    from assoc.simulation import simulate
    from assoc.tracking import TRACKERS

    if number not in _TRACKERS:
        scene = simulate("three-radar", 1, scans=3)
        _TRACKERS[number] = TRACKERS[KINDS[number]].for_scene(scene, adapt=True, registration="online"), scene
    return _TRACKERS[number]


def _live(folder: Path) -> list[Path]:
    """The lines of a scene's plots, and the state of a tracker that took them."""
    tracker, scene, _ = _live_tracker()
    lines = []
    for k in range(scene.num_scans):
        for sensor, z in zip(scene.sensors, scene.scan(k).measurements, strict=True):
            for row in np.asarray(z).tolist():
                json_line = json.dumps({"sensor": sensor.name, "time": float(scene.times[k]), "values": row})
                lines += [json_line, ",".join([sensor.name, str(scene.times[k]), *map(str, row)])]
                tracker.take(sensor.name, float(scene.times[k]), row)
    (folder / "plots.jsonl").write_text("\n".join(lines) + "\n")
    tracker.save(folder / "live.npz")
    return [folder / "plots.jsonl"]


def _live_tracker() -> tuple[Any, Any, list[str]]:
    from assoc.simulation import simulate
    from assoc.tracking import TRACKERS
    from assoc.tracking.live.live_tracker import LiveTracker

    scene, said = simulate("three-radar", 1, scans=3), list[str]()
    made = LiveTracker(scene, lambda: TRACKERS["multi-sensor"].for_scene(scene, adapt=True), tell=said.append)
    return made, scene, said


def _live_state(folder: Path) -> list[Path]:
    _live(folder)
    return [folder / "live.npz"]


def _problem_texts(folder: Path) -> list[Path]:
    return _proofs(folder, "problem")


def _proofs(folder: Path, which: str = "proof") -> list[Path]:
    """Proofs, and the problems that they are of."""
    from assoc.solvers.assign import assign
    from tests.oracles import small_problems

    paths = []
    for number, problem in enumerate(small_problems(4, seed=3, dummy=True)):
        paths.append(folder / f"{which}{number}{'.txt' if which == 'problem' else '.json'}")
        problem.save(folder / f"problem{number}.txt")
        assign(problem, proof=folder / f"proof{number}.json")
    return paths


def _track_tables(folder: Path) -> list[Path]:
    rows = ["track_id,time,x,y,z,vx,vy,vz,confirmed,sigma_x,sigma_y,sigma_z,existence"]
    rows += [f"{i},{t}.0,{100 * t + 9000 * i},{50 * i},4000,100,0,0,True,60,60,90,0.9" for t in range(0, 30, 5)
             for i in (1, 2)]  # fmt: skip
    (folder / "tracks.csv").write_text("\n".join(rows) + "\n")
    return [folder / "tracks.csv"]


def _system_tracks(folder: Path) -> list[Path]:
    import pandas as pd

    from assoc.integrations.asterix import write_tracks

    found = pd.read_csv(_track_tables(folder)[0])
    write_tracks(folder / "tracks.ast", found.drop(columns="existence"), (25, 7))
    return [folder / "tracks.ast"]


def _positions(folder: Path) -> list[Path]:
    rows = ["BaseDateTime,MMSI,LAT,LON,SOG,COG"]
    rows += [f"2024-01-01T00:{t:02d}:00,{211000000 + i},{54 + 0.01 * t},{10.0 + 0.1 * i},12.0,90.0" for t in range(20)
             for i in (1, 2)]  # fmt: skip
    (folder / "ais.csv").write_text("\n".join(rows) + "\n")
    return [folder / "ais.csv"]


def _radars(folder: Path) -> list[Path]:
    from tests.programs.test_radars import described

    return [Path(described(folder))]


def _parquet(folder: Path) -> list[Path]:
    _radars(folder)
    return [folder / "south.parquet"]


def _use_state(path: Path) -> None:
    # the case's name says nothing: each kind refuses what is not its own
    for number in range(len(KINDS)):
        tracker, scene = _tracker(number)
        with contextlib.suppress(AssocError):
            tracker.restore(path)
            tracker.step(float(scene.times[2]), scene.scan(2).measurements)
            assert np.isfinite([track.mean for track in tracker.tracks]).all()


def _use_live_state(path: Path) -> None:
    tracker, _, _ = _live_tracker()
    tracker.restore(path)
    tracker.finish()


def _use_lines(path: Path) -> None:
    from assoc._cli.track.line_form import LineForm
    from assoc._cli.track.plot_lines import Plot, parse_line

    tracker, scene, said = _live_tracker()
    form = LineForm(scene)
    for line in path.read_text(errors="replace").split("\n"):
        try:
            plot = parse_line(line, scene, form)
        except AssocError as error:
            assert "\n" not in str(error)
            continue
        if isinstance(plot, Plot):
            tracker.take(*plot[:3])
    tracker.finish()
    assert not [line for line in said if "\n" in line]


def _checked(problem: Path, proof: Path) -> None:
    from assoc.check import main

    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(io.StringIO()):
        code = main([str(problem), str(proof)])
    if code and said.getvalue().count("\n") != 1:
        raise AssertionError(f"exit code {code}: {said.getvalue()[-200:]!r}")


def _use_problem_text(path: Path) -> None:
    _checked(path, path)
    _use_problem(path)


def _use_proof(path: Path) -> None:
    for problem in sorted((path.parent.parent / "proof.json").glob("*.txt")):
        _checked(problem, path)


def _use_track_table(path: Path) -> None:
    from assoc.tracking.fusion import fuse_tables

    fuse_tables([path, path])


def _use_system_tracks(path: Path) -> None:
    from assoc.integrations.asterix import read_tracks

    read_tracks(path)


def _use_positions(path: Path) -> None:
    from assoc.recordings.flights.positions import read_positions

    read_positions(str(path))


def _use_radars(path: Path) -> None:
    from assoc._cli.track.radars_file import read_radars

    for name in ("north.csv", "south.parquet"):
        with contextlib.suppress(FileExistsError):
            (path.parent / name).symlink_to(path.parent.parent / "radars.toml" / name)
    read_radars(str(path))


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
    Room("state.npz", "npz", _states, _use_state),
    Room("live.npz", "npz", _live_state, _use_live_state),
    Room("plots.jsonl", "text", _live, _use_lines),
    Room("problem.txt", "text", _problem_texts, _use_problem_text),
    Room("proof.json", "text", _proofs, _use_proof),
    Room("track table", "text", _track_tables, _use_track_table),
    Room("tracks.ast", "bytes", _system_tracks, _use_system_tracks),
    Room("ais.csv", "text", _positions, _use_positions),
    Room("radars.toml", "text", _radars, _use_radars),
    Room("plots.parquet", "bytes", _parquet, _use_plots),
]
