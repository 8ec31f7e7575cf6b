"""The benchmark set: stored instances are those that are made, and what the table says is checked."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from assoc.problem import AssignmentProblem
from experiments.sdlib import __main__ as program
from experiments.sdlib import store
from experiments.sdlib.instances import instances
from experiments.sdlib.solve import check_row

EVERY = instances()
# `make check-set` checks the set itself, which source distributions do not have
needs_files = pytest.mark.skipif(not store.instance_file("x").parent.is_dir(), reason="the set is not here")


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
    (tmp_path / "cut.txt.xz").write_bytes(whole[:-9])
    with pytest.raises(Exception, match=r"cut.txt.xz: is damaged$"):
        AssignmentProblem.load(tmp_path / "cut.txt.xz")
