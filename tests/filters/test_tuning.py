"""The search that tunes the fuzzy rules and the IMM: its vectors, its flights, and a run from end to end."""

import json

import pytest

from assoc.filters import tuned_data
from experiments.filters import tune


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
