"""Summaries against plain readings of the table, and intervals against what is known of them."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from assoc.problem import AssignmentProblem
from assoc.sweeps import grid, load, summarize
from assoc.sweeps.study import Study
from assoc.sweeps.summary import mean_interval, paired


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


def made(rows):
    """Runs of two settings: (scan, repeat) to costs and times of both."""
    tables = [
        {"solver": "aco", "alpha": alpha, "repeat": repeat, "scene": "s", "scan": scan, "cost": value, "time": value,
         "setting": f"key{alpha}"}
        for (scan, repeat), values in rows.items()
        for alpha, value in zip((1.0, 2.0), values, strict=True)
    ]  # fmt: skip
    return pd.DataFrame(tables)


def test_settings_are_compared_in_pairs():
    """Problems differ by far more than the settings do; a run without a partner does not count."""
    rng = np.random.default_rng(1)
    rows = {
        (scan, repeat): (100.0 * scan + 1.0 + x, 100.0 * scan + y)
        for scan in range(30) for repeat in range(4) for x, y in [rng.normal(0.0, 0.1, 2)]
    }  # fmt: skip
    pairs = np.diff([*rows.values()])[:, 0]
    frame = made({**rows, (30, 0): (5.0, np.nan)})
    table = paired(frame, "key1.0", "key2.0", ("cost",))
    (row,) = table.to_dict("records")
    assert row["pairs"] == 120 and row["difference"] == pytest.approx(-pairs.mean())
    assert row["first"] - row["second"] == pytest.approx(row["difference"])
    # by the central limit theorem
    half = 1.96 * pairs.std() / np.sqrt(120)
    assert (row["low"], row["high"]) == pytest.approx((-pairs.mean() - half, -pairs.mean() + half), abs=half)


def test_the_excess_is_over_the_best_of_all_solvers(scene, tmp_path):
    problem = AssignmentProblem([[1, 1], [1, 2], [2, 1]], [-3.0, -2.0, -2.0], [2, 2])
    Study(problem, [*grid("greedy"), *grid("exact")]).run(tmp_path / "s")
    assert load(tmp_path / "s").set_index("solver")["excess"].to_dict() == {"greedy": 1.0, "exact": 0.0}
