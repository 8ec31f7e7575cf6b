"""The benchmark set: stored instances are those that are made, and what the table says is checked."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from assoc.problem import AssignmentProblem
from experiments.sdlib import __main__ as program
from experiments.sdlib import store
from experiments.sdlib.comparison import comparison_tables, excess, is_wrong, time_to_near, time_to_proof
from experiments.sdlib.contest import representatives
from experiments.sdlib.instances import PATH, instances
from experiments.sdlib.solve import check_row

EVERY = instances()
# `make check-set` checks the set itself, which source distributions do not have
needs_files = pytest.mark.skipif(not store.instance_file("x").parent.is_dir(), reason="the set is not here")


def test_names_are_those_of_the_table():
    names, rows = [one.name for one in EVERY], store.table()
    assert len(set(names)) == len(names) >= 80 and set(rows) == set(names)
    assert sum(row["status"] == "optimal" for row in rows.values()) >= 0.9 * len(rows)


@needs_files
def test_a_row_that_does_not_hold_and_an_instance_that_differs_are_seen(capsys):
    name = "axial-8-1"
    row = store.table()[name]
    assert check_row(name, row) is None
    assert "costs" in check_row(name, {**row, "value": "1"})
    assert "not the instance" in check_row(name, {**row, "digest": ""})
    one = next(one for one in EVERY if one.name == name)
    assert program._make([one, replace(one, name="axial-8-2")], compare=True) == 1
    assert capsys.readouterr() == ("2 instances, 1 differ\n", "axial-8-2: differs from what is stored\n")


def test_whoever_wants_recorded_traffic_made_is_told_what_is_missing(monkeypatch, capsys):
    monkeypatch.delenv(PATH, raising=False)
    with pytest.raises(FileNotFoundError, match="names no recording"):
        next(one for one in EVERY if one.recorded).make()
    assert program.main(["make", "--recording", "no/such.csv", "--compare"]) == 2
    assert capsys.readouterr().err == "no/such.csv: there is no such file\n"


@pytest.mark.slow
@needs_files
def test_solvers_are_compared(tmp_path, capsys):
    """A run of our solvers and a peer: judged exactly, written as a file, told as tables."""
    names = ["axial-4-1", "bearings-10-2001"]
    words = [
        "run",
        "--solvers",
        "exact,greedy,sequential,chils",
        "--seconds",
        "2",
        "--output",
        str(tmp_path / "c.json"),
    ]
    assert program.main([*words, *names]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    by_place = {(row["instance"], row["solver"]): row for row in rows}
    assert len(rows) == 8 - 2 * ("chils" not in {row["solver"] for row in rows})
    for name in names:
        row = by_place[name, "exact"]
        assert row["proved"] and row["cost"] == store.table()[name]["value"]
        assert float(by_place[name, "sequential"]["cost"]) >= float(row["cost"])
    if ("axial-4-1", "chils") in by_place:
        assert by_place["axial-4-1", "chils"]["fault"] == "cannot take it"
    text = comparison_tables(tmp_path / "c.json")
    assert "| exact | 2 |" in text and "Said to be optimal, and not: none." in text
    # what is done is not done again
    before = (tmp_path / "c.json").read_text()
    words[2] = "exact,lagrangian"
    assert program.main([*words, "--resume", *names]) == 0
    assert [json.loads(line)["solver"] for line in capsys.readouterr().out.splitlines()] == ["lagrangian"] * 2
    after = json.loads((tmp_path / "c.json").read_text())["rows"]
    assert after[:-2] == json.loads(before)["rows"]
    assert program.main([*words[:3], "--seconds", "3", *words[5:], "--resume", *names]) == 2
    assert "its rows are of 2 s, expected 3 s" in capsys.readouterr().err


def test_what_is_counted_of_a_run():
    row = {"proved": True, "cost": "-10.0", "trace": [[0.5, -9.0, -11.0], [1.5, -9.995, -10.5], [7.0, -10.0, -10.0]]}
    assert [excess(row, -10.0, mark) for mark in (0.1, 1.0, 10.0)] == [None, pytest.approx(0.1), 0.0]
    assert time_to_near(row, -10.0) == 1.5 and time_to_proof(row, -10.0) == 7.0
    # a better solution is known: what it says is not true
    assert is_wrong(row, -10.2) and time_to_proof(row, -10.2) is None and time_to_near(row, -10.2) is None


def test_two_of_each_family_represent_it():
    chosen = representatives(EVERY)
    families = [one.family for one in chosen]
    assert set(families) == {one.family for one in EVERY} and {families.count(one) for one in families} == {2}


@needs_files
def test_any_solver_can_be_run(tmp_path, capsys):
    script = tmp_path / "mine.py"
    script.write_text(
        "import sys\n"
        "lines = open(sys.argv[1]).read().split('\\n')[4:]\n"
        "alone = [l.split()[1:] for l in lines if l and sum(w != '0' for w in l.split()[1:]) == 1]\n"
        "open(sys.argv[2], 'w').write('assoc-solution 1\\n' + '\\n'.join(' '.join(one) for one in alone))\n"
    )
    command = f"{sys.executable} {script} {{instance}} {{solution}}"
    assert program.main(["run", "--command", command, "bearings-20-2001"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert row["cost"] == "0" or float(row["cost"]) == 0.0
    assert row["excess"] == pytest.approx(-float(store.table()["bearings-20-2001"]["value"]))
    assert (
        program.main(["run", "--command", f"{sys.executable} -c pass {{instance}} {{solution}}", "bearings-20-2001"])
        == 0
    )
    assert "no solution was written" in capsys.readouterr().out


@needs_files
def test_a_command_is_watched_and_stopped(tmp_path, capsys):
    """What it writes counts when it is written; after its CPU time it is stopped."""
    name = "bearings-10-2001"
    script = tmp_path / "slow.py"
    script.write_text(
        f"import shutil, sys, time\nshutil.copy({str(store.solution_file(name))!r}, sys.argv[2])\nwhile True: pass\n"
    )
    words = ["run", "--seconds", "1", "--output", str(tmp_path / "c.json")]
    assert program.main([*words, "--command", f"{sys.executable} {script} {{instance}} {{solution}}", name]) == 0
    (row,) = json.loads((tmp_path / "c.json").read_text())["rows"]
    assert row["exit"] is None and row["seconds"] >= 1.0
    assert row["cost"] == store.table()[name]["value"] and row["excess"] == 0.0
    assert row["trace"][0][0] < 1.0 and row["trace"][0][1] == float(row["cost"])
    capsys.readouterr()
    with pytest.raises(SystemExit) as stopped:
        program.main(["run", "--command", "mysolver {instance}", name])
    assert stopped.value.code == 2
    assert program.main(["run", "--command", "no-such-solver {instance} {solution}", name]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "no-such-solver: No such file or directory"


def test_packed_problems_are_read_and_refused(tmp_path):
    problem = AssignmentProblem([[1, 1], [1, 0], [0, 1]], [-2.5, 0.0, 0.0], [1, 1])
    problem.save(tmp_path / "p.txt.xz")
    again = AssignmentProblem.load(tmp_path / "p.txt.xz")
    assert np.array_equal(again.tuples, problem.tuples) and np.array_equal(again.costs, problem.costs)
    whole = (tmp_path / "p.txt.xz").read_bytes()
    for name, content in (("cut.txt.xz", whole[:-9]), ("plain.txt.xz", b"assoc-problem 1\n")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(Exception, match=rf"{name}: is damaged, or not packed as its name says"):
            AssignmentProblem.load(tmp_path / name)
