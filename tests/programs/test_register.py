"""`python -m assoc.register` as a program."""

import json

import numpy as np
import pytest

from assoc import Scene, register
from tests.registration.common import biased_scene


@pytest.fixture(scope="module")
def biased(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "biased.npz"
    biased_scene(scans=8).save(path)
    return path


@pytest.mark.slow
def test_as_a_program(run, biased, tmp_path):
    output = tmp_path / "registered.npz"
    done = run("assoc.register", biased, "-o", output, "--json", tmp_path / "biases.json", "--report")
    assert (done.returncode, done.stderr) == (0, "")
    assert "radar 1  range" in done.stdout and "9 biases from" in done.stdout
    before, after = Scene.load(biased), Scene.load(output)
    content = json.loads((tmp_path / "biases.json").read_text())
    shift = before.measurements[0][0][0, 0] - after.measurements[0][0][0, 0]
    assert shift == pytest.approx(content["biases"][0]["bias"]) and abs(shift - 300.0) < 40.0
    assert (tmp_path / "registered.html").stat().st_size > 1e6


def test_options(biased, tmp_path, capsys):
    words = [str(biased), "-o", str(tmp_path / "out.npz")]
    assert register.main([*words, "--components", "range, azimuth", "--reference", "radar 2"]) == 0
    shown = capsys.readouterr().out
    assert "radar 2" not in shown and "elevation" not in shown and shown.count("  bearing ") == 2
    # angles are in degrees here: with a spread of 0.001 deg nothing of 0.3 deg can be found
    assert register.main([*words, "--components", "azimuth", "--angle-spread", "0.001"]) == 0
    value = float(capsys.readouterr().out.splitlines()[1].split()[3])
    assert abs(value) < 0.02


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--components", "height"], "components: unknown 'height'"),
        (["--reference", "nobody"], "reference: no sensor 'nobody'"),
        (["--range-spread", "wide"], "--range-spread: expected a number, got 'wide'"),
        (["--range-spread", "-1"], "range_spread: expected a number above 0"),
        (["--max-tuples", "0"], "--max-tuples: expected a whole number >= 1"),
        (["-o", "-", "--report"], "--report: expected a file name, because --output - has none"),
        (["--write"], "--write: expected radars.toml"),
    ],
)
def test_bad_options(biased, tmp_path, capsys, words, said):
    output = tmp_path / "out.npz"
    assert register.main([str(biased), "-o", str(output), *words]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0] and not output.exists()


def test_bad_files(biased, tmp_path, capsys):
    assert register.main([str(tmp_path / "none.npz"), "-o", str(tmp_path / "out.npz")]) == 2
    assert "none.npz" in capsys.readouterr().err
    assert register.main([str(biased)]) == 2
    assert "-o: expected a file for the scene without the biases" in capsys.readouterr().err
    assert register.main([str(biased), "-o", str(biased)]) == 2
    assert "overwrite an input" in capsys.readouterr().err
    np.savez(tmp_path / "other.npz", a=np.zeros(1))
    assert register.main([str(tmp_path / "other.npz"), "-o", str(tmp_path / "out.npz")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
