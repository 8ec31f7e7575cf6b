"""The report of a study: the figures are those of the runs, and it works in a browser."""

import numpy as np
import pytest

from assoc.plotting.report import write_sweep_report
from assoc.plotting.study_figures import LABELS
from assoc.simulation import simulate
from assoc.sweeps import Study, grid, load
from assoc.sweeps.sources import StudySource
from tests.plotting.pages import EVIL, figures_of, named


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "study"
    settings = grid("aco", {"mode": ["paper"], "alpha": [1, 2, 3], "rho": [0.3, 0.9]})
    Study([StudySource(simulate("three-radar", 2, scans=4), EVIL)], settings, 3).run(path)
    return path


@pytest.fixture(scope="module")
def page(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "sweep.html"
    write_sweep_report(path, folder, words=["x.npz", "--solver", "aco"])
    return path


def test_maps_and_settings_are_those_of_the_runs(page, folder):
    frame, figures = load(folder), figures_of(page)
    (only,) = (figure for name, figure in figures.items() if name.startswith("over-two"))
    shown = named(only["data"], LABELS["iterations"])
    assert (shown["x"], shown["y"]) == (["1", "2", "3"], ["0.3", "0.9"])
    expected = frame.pivot_table(index="rho", columns="alpha", values="iterations").to_numpy(dtype=float)
    np.testing.assert_allclose(shown["z"], expected, atol=1e-6)
    assert sum(one["visible"] for one in only["data"]) == 1


def test_curves_end_at_the_mean_excess(page, folder):
    frame, data = load(folder), figures_of(page)["convergence-0"]["data"]
    best = frame.groupby(["scene", "scan"])["cost"].transform("min")
    excess = (frame["cost"] - best).groupby([frame["alpha"], frame["rho"]]).mean()
    assert len(data) == len(excess) == 6
    for (alpha, rho), expected in excess.items():
        curve = named(data, f"alpha {alpha:.4g}, rho {rho:.4g}")
        assert curve["x"] == sorted(curve["x"]) and curve["y"] == sorted(curve["y"], reverse=True)
        assert curve["y"][-1] == pytest.approx(expected, abs=1e-6)
