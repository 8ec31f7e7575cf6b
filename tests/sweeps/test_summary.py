"""Summaries against plain readings of the table, and intervals against what is known of them."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from assoc.errors import InvalidInputError
from assoc.plotting.study_figures import draw_study
from assoc.sweeps import grid, load, summarize
from assoc.sweeps.bootstrap import mean_interval, resampled_means, weighted_mean
from assoc.sweeps.store import Store
from assoc.sweeps.study import Study


def test_one_problem_many_repeats_is_the_ordinary_bootstrap():
    values = np.random.default_rng(3).exponential(2.0, (1, 80))
    low, high = mean_interval(values)
    known = stats.bootstrap((values[0],), np.mean, method="percentile", n_resamples=5000, rng=np.random.default_rng(1))
    width = known.confidence_interval.high - known.confidence_interval.low
    assert low == pytest.approx(known.confidence_interval.low, abs=0.06 * width)
    assert high == pytest.approx(known.confidence_interval.high, abs=0.06 * width)


def test_the_interval_covers_the_mean_where_problems_differ():
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(200):
        values = rng.normal(0.0, 1.0, (40, 1)) + rng.normal(0.0, 0.5, (40, 8))
        low, high = mean_interval(values, resamples=400)
        covered += low <= 0.0 <= high
    # 190 expected; repeats alone would cover about 40
    assert covered >= 180


def test_gaps_weights_and_equal_values():
    values = np.array([[1.0, np.nan], [3.0, 5.0]])
    assert weighted_mean(values) == 3.0
    low, high = mean_interval(values)
    assert 1.0 <= low < 3.0 < high <= 5.0
    assert weighted_mean(np.array([[1.0, 0.0]]), np.array([[1.0, 3.0]])) == 0.25
    assert mean_interval(np.full((7, 3), 1e9 / 3)) == (1e9 / 3, 1e9 / 3)
    assert np.isnan(mean_interval(np.full((2, 2), np.nan))).all() and np.isnan(weighted_mean(np.full((1, 1), np.nan)))


def test_settings_are_compared_over_the_same_draws():
    values = np.random.default_rng(2).normal(size=(20, 5))
    means = resampled_means(np.stack([values, values + 1.0]))
    assert means.shape == (2000, 2) and np.allclose(means[:, 1] - means[:, 0], 1.0)
    low, high = np.quantile(means[:, 0], [0.025, 0.975])
    assert (low, high) == pytest.approx(mean_interval(values))


def test_the_summary_is_the_mean_of_the_rows(study, tmp_path):
    study.run(tmp_path / "s")
    frame, table = load(tmp_path / "s"), summarize(tmp_path / "s")
    assert list(table.columns[:4]) == ["solver", "alpha", "rho", "setting"] and len(table) == 4
    pd.testing.assert_frame_equal(table, summarize(frame))
    for row in table.to_dict("records"):
        runs = frame[(frame["alpha"] == row["alpha"]) & (frame["rho"] == row["rho"])]
        assert row["runs"] == len(runs) == 10 and row["infeasible"] == 0
        assert row["cost"] == pytest.approx(runs["cost"].mean())
        assert row["optimal"] == runs["optimal"].mean()
        assert row["iterations"] == pytest.approx(runs["iterations"].mean())
        assert row["correct"] == pytest.approx(runs["correct_tuples"].sum() / runs["true_tuples"].sum())
        for name in ("cost", "gap", "optimal", "iterations", "time", "correct"):
            assert row[f"{name}_low"] <= row[name] + 1e-12 and row[name] <= row[f"{name}_high"] + 1e-12


@pytest.mark.slow
def test_every_kind_of_design_can_be_drawn(study, scene, tmp_path):
    study.run(tmp_path / "a")
    assert [path.name for path in draw_study(tmp_path / "a")] == ["heatmap.png", "convergence.png"]
    settings = [*grid("aco", {"alpha": [1, 2]}), *grid("milp", {"backend": ["scip", "highs"]}), *grid("greedy")]
    Study(study.sources, settings, 1).run(tmp_path / "b")
    drawn = [path.name for path in draw_study(tmp_path / "b")]
    assert drawn == ["heatmap-aco.png", "heatmap-milp.png", "convergence.png"]
    for path in [*tmp_path.glob("*/*.png")]:
        assert path.read_bytes().startswith(b"\x89PNG\r\n") and path.stat().st_size > 10_000
    with Store(tmp_path / "empty", study.manifest), pytest.raises(InvalidInputError, match="no runs yet"):
        draw_study(tmp_path / "empty")
