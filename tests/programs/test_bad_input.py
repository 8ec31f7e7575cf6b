"""Bad input to `python -m assoc.solve`: one line that says what and where, exit code 2 or 3, no file."""

import os
import sys
from importlib import import_module

import numpy as np
import pytest

import assoc
from assoc import inspect
from assoc._cli.program import run_program
from assoc.errors import InvalidInputError
from assoc.recordings import read_plots
from assoc.recordings.flights.reports import read_flight_reports
from assoc.scene import Scene
from assoc.simulation import simulate
from assoc.solve import main


def fields_of(path):
    with np.load(path) as data:
        return dict(data)


@pytest.fixture(scope="module")
def scene_fields(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "scene.npz"
    simulate("three-radar", scans=2).save(path)
    return fields_of(path)


def check(done, folder, message, before, code=2):
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1 and "Traceback" not in done.stderr
    assert message in done.stderr
    assert {entry.name for entry in folder.iterdir()} == before


def solve(run, folder, *words):
    before = {entry.name for entry in folder.iterdir()}
    return run("assoc.solve", *words, "--solver", "greedy", "--json", "o.json", "--csv", "o.csv", cwd=folder), before


@pytest.mark.parametrize(
    "words,message",
    [
        ([], "FILE"),
        (["s.npz", "--solver", "magic"], "unknown name 'magic'"),
        (["s.npz", "--seed", "-1"], "--seed: expected a whole number >= 0, got '-1'"),
        (["s.npz", "--time-limit", "0"], "--time-limit: expected seconds > 0"),
        (["s.npz", "--scans", "1:9"], "--scans: 1:9 is not within the scans 0:2 of s.npz"),
        (["s.npz", "--gate-probability", "2"], "--gate-probability: expected a number in (0, 1]"),
        (["s.npz", "--solver", "aco", "--rho", "2"], "rho: expected"),
        (["s.npz", "--json", "no/such/o.json"], "does not exist"),
        (["s.npz", "--json", "s.npz"], "s.npz: is given twice, or would overwrite an input file"),
        (["s.npz", "none.npz"], "none.npz: no such file"),
        (["s.npz", "--config", "broken.toml"], "broken.toml: is not a TOML file"),
        (["s.npz", "--config", "unknown.toml"], "unknown.toml: colour: unknown key"),
        (["s.npz", "--config", "type.toml"], "type.toml: seed: expected a whole number >= 0, got 'four'"),
        (["s.npz", "--config", "ants.toml"], "[aco] ants: expected a whole number, got 'many'"),
        (["s.npz", "--config", "solver.toml"], "[bees] is no solver"),
        (["s.npz", "--config", "kbest.toml"], "kbest.toml: kbest: expected a whole number >= 1, got '0'"),
        (["s.npz", "--config", "scans.toml"], "scans.toml: scans: 3:99 is not within the scans"),
    ],
)
def test_bad_options(run, tmp_path, scene_fields, words, message):
    np.savez(tmp_path / "s.npz", **scene_fields)
    (tmp_path / "unknown.toml").write_text('colour = "red"\n')
    (tmp_path / "broken.toml").write_text("colour =\n")
    (tmp_path / "type.toml").write_text('seed = "four"\n')
    (tmp_path / "ants.toml").write_text('solver = "aco"\n[aco]\nants = "many"\n')
    (tmp_path / "kbest.toml").write_text("kbest = 0\n")
    (tmp_path / "scans.toml").write_text("scans = '3:99'\n")
    (tmp_path / "solver.toml").write_text("[bees]\nants = 3\n")
    before = {entry.name for entry in tmp_path.iterdir()}
    if "--solver" not in words and not any("ants.toml" in word for word in words):
        words = [*words, "--solver", "greedy"]
    done = run("assoc.solve", *words, cwd=tmp_path)
    check(done, tmp_path, message, before)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("name", ["plots.csv", "link.csv", "plots.parquet", "scene.npz"])
def test_a_pipe_that_nobody_may_write_to_is_no_file(name, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / name).symlink_to("pipe")
    for read in (read_plots, lambda path: read_flight_reports(str(path), {}), assoc.load, Scene.load):
        with pytest.raises(InvalidInputError, match=f"{name}: is a named pipe, expected a file"):
            read(tmp_path / name)


def test_the_right_program_is_named(tmp_path, capsys):
    (tmp_path / "plots.csv").write_text("time,range,bearing\n1,2,3\n")
    (tmp_path / "radars.toml").write_text("[[radar]]\n")
    assert inspect.main([str(tmp_path / "plots.csv")]) == main([str(tmp_path / "radars.toml")]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "plots and scenes are tracked by 'assoc track'" in first
    assert "looked at by 'assoc inspect' and tracked by 'assoc track'" in second


def test_limits_and_infeasible_problems_leave_with_3(run, tmp_path, scene_fields):
    np.savez(tmp_path / "s.npz", **scene_fields)
    assoc.AssignmentProblem([[1, 1], [2, 1]], [1.0, 2.0], [2, 2], dummy=False).save(tmp_path / "p.npz")
    done, before = solve(run, tmp_path, "s.npz", "--max-tuples", 1)
    check(done, tmp_path, "tuples", before, code=3)
    done, before = solve(run, tmp_path, "p.npz")
    check(done, tmp_path, "measurement", before, code=3)


@pytest.mark.parametrize("words", [["--gate-probability", "0.9"], ["--max-tuples", "99"], ["--target-density", "auto"]])
def test_options_of_scenes_are_refused_for_problems(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    assoc.AssignmentProblem([[1, 1]], [-1.0], [1, 1]).save("p.npz")
    simulate("three-radar", scans=1).save("s.npz")
    assert main(["p.npz", *words]) == 2
    assert (
        f"{words[0]}: is only for scenes, not for problems, which have their tuples already" in capsys.readouterr().err
    )
    # beside a scene they are of use
    assert main(["p.npz", "s.npz", *words]) == 0


def test_a_dependency_that_was_left_out_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert run_program(lambda: import_module("pandas"), "assoc.track") == 2
    said = "assoc.track: error: pandas is not installed: python -m pip install pandas\n"
    assert capsys.readouterr().err == said
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        run_program(lambda: import_module("no_such_module"), "assoc.track")
