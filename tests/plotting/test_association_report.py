"""The report of an association as a file: what is in it, that it is safe, and that it needs nothing else."""

import html
import re

import numpy as np
import pytest

import assoc
from assoc.association.solving import ScanOptions, associate_scans, gathered
from assoc.plotting.report import write_association_report
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.simulation import simulate
from tests.plotting.pages import EVIL, figures_of, parsed, step_of, text_of


@pytest.fixture(scope="module")
def scene():
    return simulate("three-radar", 2, scans=8)


@pytest.fixture(scope="module")
def association(scene):
    return assoc.associate(scene, "exact")


@pytest.fixture(scope="module")
def page(scene, association, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "out.html"
    write_association_report(path, association, scene, ["s.npz"] * 8, words=["s.npz", "--report", "out.html"])
    return path


def test_nothing_is_loaded_from_outside(page):
    reader = parsed(page)
    assert not [tag for tag, given in reader.tags if tag in ("link", "img", "iframe", "object") or "src" in given]
    policy = next(given["content"] for tag, given in reader.tags if given.get("http-equiv"))
    assert policy.startswith("default-src 'none'") and "unsafe-inline'; script-src 'sha256-" in policy
    assert "unsafe-eval" not in policy and "http" not in policy


def test_the_figure_of_each_scan_is_that_of_the_association(page, scene, association):
    figure = figures_of(page)["scene-0"]
    steps = figure["layout"]["sliders"][0]["steps"]
    assert len(figure["frames"]) == len(steps) == 8
    for k, one in enumerate(association.scans):
        singles = np.count_nonzero(one.solution.tuples, axis=1) == 1
        assert f": {len(one.targets)} targets, {singles.sum()} false alarms" in steps[k]["label"]
        found = step_of(figure, k, "targets found")
        assert found["x"] == pytest.approx((1e-3 * one.positions[:, 0]).tolist(), abs=6e-4)
        assert step_of(figure, k, "truth")["y"] == pytest.approx(
            (1e-3 * scene.truth.positions[k][:, 1]).tolist(), abs=6e-4
        )
        costs = [float(re.search(r"cost (\S+?)<br>", text)[1]) for text in found["hovertext"]]
        assert sum(costs) == pytest.approx(one.solution.cost, rel=1e-3)
        for s, sensor in enumerate(scene.sensors):
            drawn = step_of(figure, k, sensor.name)
            assert len(drawn["x"]) == np.count_nonzero(one.targets[:, s])
            for t, index in enumerate(one.targets[:, s]):
                told = re.search(rf"{sensor.name} no. {index}: range (\S+) m", found["hovertext"][t])
                assert (told is not None) == (index > 0)
                if index:
                    # the range of the fused position, by hand
                    rest = scene.measurements[k][s][index - 1][0] - np.linalg.norm(one.positions[t] - sensor.position)
                    assert float(told[1]) == pytest.approx(rest, rel=1e-2)
        # ellipses of 95 %: their half axes hold 2.4477 standard deviations
        outline = step_of(figure, k, "95 % ellipses")
        x = [value for value in outline["x"][:49] if value is not None]
        assert (max(x) - min(x)) / 2 == pytest.approx(2.4477e-3 * np.sqrt(one.covariances[0, 0, 0]), rel=0.05, abs=1e-3)


def test_text_from_files_is_only_text(tmp_path):
    sensors = [
        Radar3D(position=(0, 0, 0), noise=(10, 1e-3, 1e-3), field_of_view=[[0, 1e4], [-3, 3], [0, 1]], name=EVIL),
        Radar3D(position=(9, 0, 0), noise=(10, 1e-3, 1e-3), field_of_view=[[0, 1e4], [-3, 3], [0, 1]], name="<!--"),
    ]
    z = sensors[0].measure(np.array([[1e3, 2e3, 300.0]]))
    evil = Scene(sensors, [0.0], [[z, sensors[1].measure(np.array([[1e3, 2e3, 300.0]]))]], name="</script>" + EVIL)
    path = tmp_path / "out.html"
    # the first call compiles, and its report says so
    assoc.associate(evil)
    write_association_report(path, assoc.associate(evil), evil, ['"><b>x.npz'], words=["x", EVIL])
    harmless = tmp_path / "harmless.html"
    plain = Scene([*sensors], [0.0], evil.measurements, name="n")
    for sensor in plain.sensors:
        object.__setattr__(sensor, "name", "n")
    write_association_report(harmless, assoc.associate(plain), plain, ["x.npz"], words=["x", "y"])
    reader = parsed(path)
    assert [tag for tag, _ in reader.tags] == [tag for tag, _ in parsed(harmless).tags]
    text = text_of(path)
    assert EVIL in text and '"><b>x.npz' in text
    assert html.escape(EVIL) in {trace["name"] for trace in figures_of(path)["scene-0"]["data"]}


def test_problems_and_several_sources(tmp_path, scene, association):
    problem = assoc.AssignmentProblem([[1, 1], [1, 2], [2, 2]], [-3.0, -1.0, -2.0], [2, 2])
    both = assoc.Association(
        (*association.scans[:2], *_of_problem(problem).scans), association.solver, association.parameters
    )
    path = tmp_path / "out.html"
    write_association_report(path, both, [scene, scene, problem], ["a.npz", "a.npz", "b.npz"])
    figures, text = figures_of(path), text_of(path)
    assert [name for name in figures if name.startswith("scene")] == ["scene-0"]
    assert len(figures["scene-0"]["frames"]) == 2 and "b.npz" in text
    assert {"-3.0000", "-2.0000"} <= {*parsed(path).text}
    with pytest.raises(assoc.InvalidInputError, match="one for each of the 3 scans"):
        write_association_report(path, both, [scene, problem])


def _of_problem(problem):
    options = ScanOptions("exact")
    return gathered(associate_scans((problem,), options), options)


@pytest.mark.slow
def test_a_hundred_scans_stay_below_nine_megabytes(tmp_path):
    scene = simulate("crowd", 0, targets=60, scans=100)
    path = tmp_path / "out.html"
    write_association_report(path, assoc.associate(scene, "greedy"), scene)
    assert path.stat().st_size < 9_000_000
