"""Claims decide, round-trip and print."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from experiments.common import claims
from experiments.common.claims import Claim
from experiments.common.command import mean_interval, replaced, rmse_interval
from experiments.common.results import print_claims

SAMPLE = [
    Claim("mean cycles", "", 4.03, 4.9, (4.8, 5.0), (3.5, 5.5)),
    Claim("time of a scan", "ms", None, 2.5, band=(None, 2.0)),
    Claim("no accepted band", "km", 1.0, 2.0),
]


def test_holds_follows_the_band_unless_given() -> None:
    assert [c.holds for c in SAMPLE] == [True, False, None]
    assert Claim("x", ours=1.0, band=(1.0, 1.0)).holds is True
    assert Claim("x", ours=0.9, band=(1.0, None)).holds is False
    assert Claim("x", ours=0.9, band=(1.0, None), holds=True).holds is True


@pytest.mark.parametrize(
    "bad",
    [
        {},
        {"ours": 1.0, "paper": float("nan")},
        {"ours": 1.0, "band": (2, 1)},
        {"ours": 1, "interval": (2, 1)},
    ],
)
def test_nonsense_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="claim 'x'"):
        Claim("x", **bad)  # type: ignore[arg-type]


def test_json_round_trip_and_form(tmp_path: Path) -> None:
    path = tmp_path / "claims.json"
    claims.save_json(path, SAMPLE, "sample", 7)
    assert claims.load_json(path) == SAMPLE
    data = json.loads(path.read_text())
    assert {k: data[k] for k in ("format", "version", "experiment", "seed")} == {
        "format": "assoc.claims",
        "version": 1,
        "experiment": "sample",
        "seed": 7,
    }
    assert list(data["claims"][0]) == ["quantity", "unit", "paper", "ours", "interval", "band", "holds", "source"]
    path.write_text(json.dumps({**data, "version": 2}))
    with pytest.raises(ValueError, match="version 2"):
        claims.load_json(path)
    path.write_text("[]")
    with pytest.raises(ValueError, match=r"not an assoc\.claims file"):
        claims.load_json(path)


def test_table_shows_every_claim(capsys: pytest.CaptureFixture[str]) -> None:
    print_claims(SAMPLE, "Sample")
    text = capsys.readouterr().out
    assert all(c.quantity in text for c in SAMPLE)
    assert "<= 2" in text
    assert "3.5 .. 5.5" in text


def test_rows_of_a_partial_run_replace_those_of_the_file() -> None:
    newer = [Claim("time of a scan", "ms", ours=1.0), Claim("p99 of a scan", "ms", ours=3.0)]
    found = replaced(SAMPLE, newer)
    assert [c.quantity for c in found] == ["mean cycles", "time of a scan", "p99 of a scan", "no accepted band"]
    assert found[1] is newer[0] and found[0] is SAMPLE[0] and len(SAMPLE) == 3
    assert replaced([], newer) == newer


@pytest.mark.parametrize("runs", [2, 3, 10])
def test_intervals_of_few_runs_cover_as_often_as_they_say(runs):
    """Of 4,000 means of normal values 95 % lie inside, to three standard deviations of such a count."""
    values = np.random.default_rng(0).normal(7.0, 2.0, (4000, runs))
    inside = [low <= 7.0 <= high for low, high in map(mean_interval, values)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.0104)
    one = values[0]
    assert mean_interval(one) == pytest.approx(stats.t.interval(0.95, runs - 1, one.mean(), stats.sem(one)))
    assert rmse_interval(one[None] ** 2)[1] ** 2 == pytest.approx(mean_interval(one**2)[1])
