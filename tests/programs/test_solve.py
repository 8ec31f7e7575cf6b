"""`python -m assoc.solve` as a program: what it prints and writes."""

import csv
import json
import os
import re

import pytest

import assoc
from assoc.simulation import simulate
from tests.programs.terminal import shown


def content(path):
    """A result file without what the clock decides."""
    result = json.loads(path.read_text())
    for one in (result["totals"], *result["scans"]):
        del one["runtime"], one["compile_time"]
    return result


def table(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_table_json_and_csv_agree(run, scene_file, tmp_path):
    json_file, csv_file = tmp_path / "o.json", tmp_path / "o.csv"
    words = ["assoc.solve", scene_file, "--solver", "milp", "--json", json_file, "--csv", csv_file]
    done = run(*words)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].split() == ("scan measurements targets false alarms cost lower bound gap status ms correct".split())
    assert [line.split()[0] for line in lines[1:7]] == list("012345")
    assert "6 of 6 scans certified optimal" in done.stdout and "true tuples correct" in done.stdout
    assert re.search(r" s of it in the solver, \d+\.\d\d s compiling$", done.stdout, re.M)
    scans = json.loads(json_file.read_text())["scans"]
    rows = table(csv_file)
    expected = assoc.associate(assoc.Scene.load(scene_file), "milp")
    for scan, row, one in zip(scans, rows, expected.scans, strict=True):
        assert scan["cost"] == float(row["cost"]) == pytest.approx(one.solution.cost)
        assert scan["tuples"] == one.solution.tuples.tolist()
        assert scan["status"] == row["status"] == "optimal"
        assert row["sizes"] == " ".join(map(str, scan["sizes"]))


@pytest.mark.slow
def test_jobs_do_not_change_the_result(run, scene_file, tmp_path):
    results = []
    for jobs in (1, 2, 4):
        path = tmp_path / f"{jobs}.json"
        words = ["--solver", "aco", "--mode", "paper", "--seed", 3, "--jobs", jobs, "--json", path]
        done = run("assoc.solve", scene_file, *words)
        assert (done.returncode, done.stderr) == (0, "")
        results.append(content(path))
    assert results[0] == results[1] == results[2]
    assert results[0]["seed"] == 3 and results[0]["parameters"]["mode"] == "paper"


def test_several_files_and_problems(run, scene_file, tmp_path):
    problem = assoc.AssignmentProblem([[1, 1], [1, 2]], [-3.0, -1.0], [1, 2])
    problem.save(tmp_path / "problem.npz")
    path = tmp_path / "o.json"
    done = run("assoc.solve", scene_file, tmp_path / "problem.npz", "--solver", "greedy", "--json", path)
    assert (done.returncode, done.stderr) == (0, "")
    scans = json.loads(path.read_text())["scans"]
    assert [scan["file"] for scan in scans] == [str(scene_file)] * 6 + [str(tmp_path / "problem.npz")]
    last = scans[-1]
    assert (last["time"], last["cost"], last["tuples"]) == (None, -3.0, [[0, 2], [1, 1]])
    assert last["targets"] == [{"tuple": [1, 1], "position": None, "covariance": None}]


def test_parameters_from_options_and_from_a_file(run, scene_file, tmp_path):
    config = tmp_path / "c.toml"
    config.write_text('solver = "aco"\nseed = 4\nscans = "0:2"\n\n[aco]\nants = 7\nalpha = 2\n\n[milp]\n')
    path = tmp_path / "o.json"
    done = run("assoc.solve", scene_file, "--config", config, "--ants", 9, "--rho", 0.3, "--json", path)
    assert (done.returncode, done.stderr) == (0, "")
    result = content(path)
    chosen = result["parameters"]
    assert (result["solver"], result["seed"], len(result["scans"])) == ("aco", 4, 2)
    # the command line comes before the file, the file before the defaults
    assert (chosen["ants"], chosen["alpha"], chosen["rho"], chosen["beta"]) == (9, 2.0, 0.3, 1.0)


@pytest.mark.slow
def test_time_limit_is_for_each_scan(run, tmp_path):
    path = tmp_path / "ghosts.npz"
    simulate("bearing-only", targets=40, scans=2).save(path)
    result = tmp_path / "o.json"
    words = ["--solver", "aco", "--time-limit", "0.5", "--iterations", 10**9, "--patience", 10**9]
    done = run("assoc.solve", path, *words, "--json", result, "--csv", tmp_path / "o.csv")
    assert (done.returncode, done.stderr) == (0, "")
    for scan in json.loads(result.read_text())["scans"]:
        assert scan["cost"] >= scan["lower_bound"] - 1e-9
    rows = table(tmp_path / "o.csv")
    assert all(row["stopped_by"] in ("time_limit", "gap") for row in rows)


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
def test_on_a_terminal_the_table_is_drawn(scene_file):
    text = shown(["assoc.solve", scene_file, "--solver", "greedy"])
    assert "─" in text and "associating" in text and "false alarms" in text
    # a scan that is not certified optimal shows its gap in the place of its status
    assert "certified optimal" in text and "lower bound  " not in text


def test_kbest_ranks_every_scan(run, scene_file, tmp_path):
    json_file, csv_file = tmp_path / "o.json", tmp_path / "o.csv"
    done = run("assoc.solve", scene_file, "--kbest", 3, "--scans", "0:2", "--json", json_file, "--csv", csv_file)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0].split()[:2] == ["scan", "rank"]
    content = json.loads(json_file.read_text())
    assert (content["solver"], content["parameters"]) == ("kbest", {"k": 3})
    scene = assoc.Scene.load(scene_file)
    rows = table(csv_file)
    assert [(row["scan"], row["rank"]) for row in rows] == [(s, r) for s in "01" for r in "123"]
    for number, scan in enumerate(content["scans"]):
        expected = assoc.kbest(assoc.build_problem(scene, number), 3)
        assert [one["cost"] for one in scan["ranked"]] == pytest.approx([one.cost for one in expected])
        assert [one["rank"] for one in scan["ranked"]] == [1, 2, 3]
        assert scan["cost"] == scan["ranked"][0]["cost"] == float(rows[3 * number]["cost"])
        assert scan["ranked"][2]["tuples"] == expected[2].tuples.tolist()
