"""The experiment on the ant colony paper's Table 1: its arithmetic on made-up runs, and a small real one."""

from __future__ import annotations

import json

import numpy as np
import pytest

from experiments.common.claims import load_json
from experiments.papers.ant_colony import __main__ as experiment


def measured(cycles):
    """A mode in which setting i takes cycles[i] in every run."""
    values = np.broadcast_to(np.array(cycles, dtype=float)[:, None, None], (24, 6, 3))
    return experiment.Measured(values, np.ones_like(values), 1e-3 * values)


def by_name(claims):
    return {claim.quantity: claim for claim in claims}


def test_the_table_is_the_papers():
    assert len(experiment.PAPER) == 24
    assert experiment.PAPER[1, 2, 0.5] == 4.10 and experiment.PAPER[2, 3, 0.7] == 4.11
    assert min(experiment.PAPER, key=experiment.PAPER.__getitem__) == experiment.BEST
    assert sum(experiment.PAPER.values()) == pytest.approx(97.63)


def test_runs_like_the_papers_confirm_it():
    one = measured(list(experiment.PAPER.values()))
    found = by_name(experiment.claims({"paper": one, "mmas": one}))
    for name in (
        "mode paper: mean cycles over all settings",
        "mode paper: largest less smallest mean cycles of a setting",
        "mode paper: cycles, alpha > beta less the others, whole interval below 0",
        "mode paper: rank in cycles of alpha 2 beta 1 rho 0.3 of 24",
        "mode paper: cycles, alpha 2 beta 1 rho 0.3 less the best other, whole interval below 0",
    ):
        assert found[name].holds, name
        assert found[name].paper == pytest.approx(found[name].ours)
    assert all(c.holds for name, c in found.items() if "mean cycles to convergence" in name)


def test_equal_settings_confirm_nothing():
    one = measured([6.0] * 24)
    found = by_name(experiment.claims({"paper": one, "mmas": one}))
    for mode in ("paper", "mmas"):
        rank = found[f"mode {mode}: rank in cycles of alpha 2 beta 1 rho 0.3 of 24"]
        assert (rank.ours, rank.holds) == (12.5, False)
        assert found[f"mode {mode}: cycles, alpha > beta less the others, whole interval below 0"].holds is False
    assert found["mode paper: mean cycles over all settings"].holds is False


def test_a_small_run(tmp_path, capsys):
    words = [
        "--scans",
        "3",
        "--seeds",
        "2",
        "--jobs",
        "1",
        "-o",
        str(tmp_path / "o"),
        "--json",
        str(tmp_path / "c.json"),
    ]
    assert experiment.main(words) == 0
    out = capsys.readouterr().out
    assert "288 runs (3 scans, 2 seeds)" in out and "Table 1 and its conclusions" in out
    content = json.loads((tmp_path / "c.json").read_text())
    assert (content["format"], content["experiment"], content["seed"]) == ("assoc.claims", "papers.ant_colony", 0)
    claims = load_json(tmp_path / "c.json")
    assert sum("mode paper: mean cycles to convergence" in claim.quantity for claim in claims) == 24
    for name in ("settings.csv", "claims.csv", "claims.json", "table_1.png", "figure_3.png"):
        assert (tmp_path / "o" / name).stat().st_size > 500
    assert (tmp_path / "o" / "table_1.png").read_bytes().startswith(b"\x89PNG")
