"""Tuning: a search that finds what is there, goes on where it was stopped, and reports on what it never saw."""

import json

import pytest

from assoc.sweeps import load, tune
from assoc.sweeps.design import Range


def test_the_search_finds_the_better_half_and_reports_held_out_runs(study, tmp_path):
    # one ant cannot disagree with itself: it stops after the greedy cycle, with a gap
    space = {"mode": ("paper",), "ants": Range(1, 20, whole=True), "iterations": (1,)}
    report = tune(tmp_path / "t", study.sources, "aco", space, 8, repeats=2, seed=1)
    assert report.default.parameters["mode"] == "paper" and report.default.parameters["ants"] == 15
    assert report.training[1] <= report.training[0]
    frame = load(tmp_path / "t")
    held = frame[frame["repeat"] >= 2]
    assert set(frame[frame["repeat"] < 2]["scan"]) == {0, 2, 4} and set(held["scan"]) == {1, 3}
    assert set(held["setting"]) == {report.default.key, report.tuned.key}
    table = report.table.set_index("measure")
    for column, setting in (("first", report.tuned), ("second", report.default)):
        mean = held[held["setting"] == setting.key]["gap"].mean()
        assert table.loc["score", column] == pytest.approx(mean) == table.loc["gap", column]
    saved = json.loads((tmp_path / "t" / "tuning.json").read_text())
    assert saved["tuned"] == dict(report.tuned.parameters)
    # the same again only reads
    again = tune(tmp_path / "t", study.sources, "aco", space, 8, repeats=2, seed=1)
    assert again.tuned == report.tuned and len(load(tmp_path / "t")) == len(frame)
