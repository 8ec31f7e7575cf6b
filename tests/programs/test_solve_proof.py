"""``solve --proof``: what it writes convinces the checker."""

import pytest


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
