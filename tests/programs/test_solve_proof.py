"""``solve --proof``: what it writes convinces the checker."""

import pytest

import assoc
from assoc import solve


@pytest.fixture
def folder(run, tmp_path):
    run("assoc.simulate", "three-radar", "--scans", "3", "-o", "s.npz", cwd=tmp_path)
    return tmp_path


def test_proof_of_a_scan_is_accepted(run, folder):
    done = run("assoc.solve", "s.npz", "--scans", "1", "--proof", "p.json", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    checked = run("assoc.check", "p.txt", "p.json", cwd=folder)
    assert checked.returncode == 0
    assert "proved: no solution costs less" in checked.stdout and "(gap 0.000000" in checked.stdout


@pytest.mark.parametrize(
    "words,message",
    [
        (["--proof", "p.json"], "--proof: is of one scan, got 3; choose it with --scans K"),
        (["--scans", "1", "--proof", "p.txt"], ".json"),
        (["--scans", "1", "--proof", "no/such/p.json"], "does not exist"),
    ],
)
def test_bad_input(run, folder, words, message):
    done = run("assoc.solve", "s.npz", *words, cwd=folder)
    assert done.returncode == 2
    assert message in done.stderr and done.stderr.count("\n") == 1
    assert not list(folder.glob("p*"))


def test_the_problem_beside_a_proof_overwrites_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assoc.AssignmentProblem([[1, 1]], [-1.0], [1, 1]).save("p.txt")
    before = (tmp_path / "p.txt").read_text()
    for words, message in [
        (["--proof", "p.json"], "p.txt: is given twice, or would overwrite an input file"),
        (["--proof", "q.json", "--csv", "q.txt"], "q.txt: is given twice"),
        (["--proof", "-"], "--proof: -: expected a name that ends in .json"),
        (["--proof", "/dev/null"], "--proof: /dev/null: expected a name that ends in .json"),
    ]:
        assert solve.main(["p.txt", *words]) == 2
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
    assert {one.name for one in tmp_path.iterdir()} == {"p.txt"} and (tmp_path / "p.txt").read_text() == before
    assert solve.main(["p.txt", "--proof", "q.json", "-q"]) == 0
    assert {one.name for one in tmp_path.iterdir()} == {"p.txt", "q.txt", "q.json"}
