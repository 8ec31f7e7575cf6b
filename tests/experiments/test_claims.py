"""Claims decide, round-trip and print."""

import numpy as np
import pytest
from scipy import stats

from experiments.common.claims import Claim
from experiments.common.command import mean_interval, replaced, rmse_interval

SAMPLE = [
    Claim("mean cycles", "", 4.03, 4.9, (4.8, 5.0), (3.5, 5.5)),
    Claim("time of a scan", "ms", None, 2.5, band=(None, 2.0)),
    Claim("no accepted band", "km", 1.0, 2.0),
]


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
