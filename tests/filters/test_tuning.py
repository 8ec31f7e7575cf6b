"""The search that tunes the fuzzy rules and the IMM: its vectors, its flights, and a run from end to end."""

import json

import numpy as np
import pytest

from assoc.filters import tuned_data
from experiments.filters import tune


def test_vectors_are_the_parameters():
    data = tuned_data()
    again = tune.fuzzy_data(tune.fuzzy_vector(data), data)
    for name in ("inputs", "outputs", "calm"):
        np.testing.assert_allclose(again[name], data[name], rtol=1e-12)
    for one, other in zip(again["others"], data["others"], strict=True):
        np.testing.assert_allclose(one["inputs"], other["inputs"], rtol=1e-12)
        assert {**one, "inputs": 0} == {**other, "inputs": 0}
    mixed = tune.imm_data(tune.imm_vector(data["imm"]))
    for name, value in data["imm"].items():
        assert mixed[name] == pytest.approx(max(value, tune.LEAST), rel=1e-9)


def test_wherever_the_search_goes_centres_increase():
    rng = np.random.default_rng(0)
    like = tuned_data()
    for _ in range(20):
        data = tune.fuzzy_data(rng.normal(0, 3, len(tune.fuzzy_vector(like))), like)
        inputs = [data["inputs"], *(one["inputs"] for one in data["others"])]
        assert all(np.diff([0.0, *one]).min() > 0 for one in inputs)
        assert all(np.diff(one).min() > 0 for one in (*data["outputs"], data["calm"]))


@pytest.mark.slow
def test_end_to_end(tmp_path, capsys):
    pytest.importorskip("cma")
    texts = []
    for _ in range(2):
        output = tmp_path / "tuned.json"
        assert tune.main(["--evaluations", "1", "--flights", "2", "--seed", "3", "--output", str(output)]) == 0
        texts.append(output.read_text())
    assert texts[0] == texts[1]
    data = json.loads(texts[0])
    assert set(data) == set(tuned_data()) and "--seed 3 on 2 random flights" in data["about"]
    told = capsys.readouterr().out
    for name in ("fuzzy", "IMM"):
        line = next(line for line in told.splitlines() if line.startswith(f"{name}: ") and "at the start" in line)
        start, end = (float(word) for word in (line.split()[1], line.split()[6]))
        assert end <= start
