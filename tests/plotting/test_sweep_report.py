"""The report and the figures of a study: they are those of the runs."""

import base64
import re

import numpy as np
import pytest

from assoc.plotting.report import write_sweep_report
from assoc.plotting.study_figures import convergence, heat_maps, new_figure
from assoc.simulation import simulate
from assoc.sweeps import Study, grid, load
from assoc.sweeps.frame import load_traces
from assoc.sweeps.sources import StudySource
from tests.plotting.pages import EVIL, parsed


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "study"
    settings = grid("aco", {"mode": ["paper"], "alpha": [1, 2, 3], "rho": [0.3, 0.9]})
    Study([StudySource(simulate("three-radar", 2, scans=4), EVIL)], settings, 3).run(path)
    return path


def test_the_page_shows_both_figures_and_all_settings(folder, tmp_path):
    path = tmp_path / "sweep.html"
    write_sweep_report(path, folder, words=["x.npz", "--solver", "aco"])
    page = parsed(path)
    sources = [given["src"] for tag, given in page.tags if tag == "img"]
    drawn = [base64.b64decode(one.removeprefix("data:image/svg+xml;base64,")) for one in sources]
    assert len(drawn) == 2 and all(one.startswith(b"<?xml") and one.count(b"<path") > 50 for one in drawn)
    assert "script" not in [tag for tag, _ in page.tags][:-1] and EVIL in " ".join(page.text)
    rows = re.findall(r"<tr>.*?</tr>", path.read_text())
    assert sum("<td>aco</td>" in row for row in rows) == 6


def test_maps_are_those_of_the_runs(folder):
    frame = load(folder)
    figure = heat_maps(frame, new_figure())
    (axes,) = (ax for ax in figure.axes if ax.get_images() and "iterations" in str(colour_bar(ax)))
    expected = frame.pivot_table(index="rho", columns="alpha", values="iterations").to_numpy(dtype=float)
    np.testing.assert_allclose(axes.get_images()[0].get_array(), expected, atol=1e-6)
    assert [text.get_text() for text in axes.get_xticklabels()] == ["1", "2", "3"]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["0.3", "0.9"]


def colour_bar(axes):
    bar = axes.get_images()[0].colorbar
    return bar and bar.ax.get_ylabel()


def test_curves_end_at_the_mean_excess(folder):
    frame = load(folder)
    best = frame.groupby(["scene", "scan"])["cost"].transform("min")
    excess = (frame["cost"] - best).groupby([frame["alpha"], frame["rho"]]).mean()
    curves = {one.get_label(): one for one in convergence(frame, load_traces(folder), new_figure()).axes[0].lines}
    assert len(curves) == len(excess) == 6
    for (alpha, rho), expected in excess.items():
        x, y = curves[f"alpha {alpha:.4g}, rho {rho:.4g}"].get_data()
        assert [*x] == sorted(x) and [*y] == sorted(y, reverse=True)
        assert y[-1] == pytest.approx(expected, abs=1e-6)
