"""The report of an association as a file: what is in it, that it is safe, and that it needs nothing else."""

import json
import re
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import assoc
from assoc.plotting.report import write_association_report
from assoc.plotting.report.views import thin
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.simulation import simulate
from tests.running import here

EVIL = "<script>alert(1)</script>"


def data_of(path):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', path.read_text(), re.S)
    return json.loads(found.group(1))


class Texts(HTMLParser):
    """Tags with their attributes, and the text outside of scripts and styles."""

    def __init__(self):
        super().__init__()
        self.tags, self.text, self.open = [], [], None

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.open = tag if tag in ("script", "style") else None

    def handle_endtag(self, tag):
        self.open = None

    def handle_data(self, data):
        if self.open is None:
            self.text.append(data)


def parsed(path):
    reader = Texts()
    reader.feed(path.read_text())
    return reader


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


def test_costs_and_residuals_are_those_of_the_association(page, scene, association):
    data = data_of(page)
    assert len(data["scans"]) == 8
    for drawn, one in zip(data["scans"], association.scans, strict=True):
        singles = np.count_nonzero(one.solution.tuples, axis=1) == 1
        assert sum(drawn["costs"]) == pytest.approx(one.solution.cost, abs=1e-3)
        assert drawn["falseAlarms"] == singles.sum() and drawn["tuples"] == one.targets.tolist()
        scan = scene.scan(one.scan)
        for s, sensor in enumerate(scene.sensors):
            rows = iter(drawn["view"]["residuals"][s])
            for t, index in enumerate(one.targets[:, s]):
                if index:
                    # range, azimuth, elevation of the fused position, by hand
                    d = one.positions[t] - sensor.position
                    ground = np.hypot(d[0], d[1])
                    seen = [np.hypot(ground, d[2]), np.arctan2(d[1], d[0]), np.arctan2(d[2], ground)]
                    expected = scan.measurements[s][index - 1] - seen
                    assert next(rows) == pytest.approx(expected, rel=1e-3)
            assert next(rows, None) is None
            # and the place of a measurement measures like the measurement
            at = np.array(drawn["view"]["measured"][s]["at"])
            back = sensor.residual(sensor.measure(at), scan.measurements[s])
            assert np.abs(back / [1.0, 1e-4, 1e-4]).max() < 1.0


def test_command_parameters_and_versions_are_said(page):
    text = " ".join(parsed(page).text)
    command = "python -m assoc.solve s.npz --report out.html"
    for word in (command, "three-radar", assoc.__version__, np.__version__, "seed"):
        assert word in text


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
    text = " ".join(reader.text)
    assert EVIL in text and '"><b>x.npz' in text
    assert data_of(path)["sources"][0]["sensors"][0]["name"] == EVIL


def test_problems_and_several_sources(tmp_path, scene, association):
    problem = assoc.AssignmentProblem([[1, 1], [1, 2], [2, 2]], [-3.0, -1.0, -2.0], [2, 2])
    both = assoc.Association(
        (*association.scans[:2], *_of_problem(problem).scans), association.solver, association.parameters
    )
    path = tmp_path / "out.html"
    write_association_report(path, both, [scene, scene, problem], ["a.npz", "a.npz", "b.npz"])
    data = data_of(path)
    assert [scan["source"] for scan in data["scans"]] == [0, 0, 1]
    assert data["scans"][2]["view"] is None and sorted(data["scans"][2]["costs"]) == [-3.0, -2.0]
    with pytest.raises(assoc.InvalidInputError, match="one for each of the 3 scans"):
        write_association_report(path, both, [scene, problem])


def _of_problem(problem):
    from assoc.association.plan import Plan

    plan = Plan((problem,), "exact")
    return plan.gather(plan.run(plan.items()))


def test_ranked_associations_say_how_far_the_second_is(tmp_path, scene):
    from assoc.association.plan import Plan

    plan = Plan((scene,), "exact", kbest=3)
    ranked = plan.gather(plan.run(plan.items()[:2]))
    path = tmp_path / "out.html"
    write_association_report(path, ranked, scene)
    assert "to the second best" in " ".join(parsed(path).text)
    for drawn, one in zip(data_of(path)["scans"], ranked.scans, strict=True):
        assert drawn["ranked"] == [other.solution.cost for other in one.ranked]


def test_views_beyond_the_budget_are_thinned_evenly():
    scans = [{"view": None} for _ in range(10)]
    kept = thin(({"x": "y" * 92} for _ in range(10)), scans, budget=450)
    assert kept == 4 and [i for i, scan in enumerate(scans) if scan["view"]] == [0, 3, 6, 9]
    assert thin(({"x": "y" * 92} for _ in range(10)), scans, budget=10_000) == 10


@pytest.mark.slow
def test_a_hundred_scans_stay_below_eight_megabytes(tmp_path):
    scene = simulate("crowd", 0, targets=60, scans=100)
    path = tmp_path / "out.html"
    write_association_report(path, assoc.associate(scene, "greedy"), scene)
    assert path.stat().st_size < 8_000_000


def test_nothing_is_left_where_it_cannot_be_written(tmp_path, scene, association):
    with pytest.raises(assoc.InvalidInputError, match="does not exist"):
        write_association_report(tmp_path / "none" / "out.html", association, scene)
    (tmp_path / "folder").mkdir()
    with pytest.raises(assoc.InvalidInputError, match="is a folder"):
        write_association_report(tmp_path / "folder", association, scene)
    assert [one.name for one in tmp_path.iterdir()] == ["folder"]


def test_without_plotly_it_is_said_before_the_work(tmp_path, scene, association, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(ImportError, match=r"python -m pip install 'assoc\[report\]'"):
        write_association_report(tmp_path / "out.html", association, scene)
    scene.save(tmp_path / "scene.npz")
    done = here("assoc.solve", "scene.npz", "--report", "out.html", "--csv", "out.csv", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert "pip install 'assoc[report]'" in done.stderr
    assert not (tmp_path / "out.html").exists() and not (tmp_path / "out.csv").exists()


@pytest.mark.slow
def test_the_program_writes_it(tmp_path, scene):
    scene.save(tmp_path / "scene.npz")
    words = ["scene.npz", "--solver", "greedy", "--scans", "2:5", "--report", "out.html"]
    done = here("assoc.solve", *words, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [scan["scan"] for scan in data_of(tmp_path / "out.html")["scans"]] == [2, 3, 4]
    assert "python -m assoc.solve " + " ".join(words) in " ".join(parsed(tmp_path / "out.html").text)


def test_compiling_is_told_apart_from_solving(scene, association, tmp_path):
    first, *others = association.scans
    scans = (replace(first, compile_time=12.5), *(replace(one, compile_time=0.0) for one in others))
    for name, content in (("cold.html", scans), ("warm.html", scans[1:])):
        write_association_report(tmp_path / name, replace(association, scans=content), scene)
    assert "12.5 s" in parsed(tmp_path / "cold.html").text
    assert "Compiling" not in parsed(tmp_path / "warm.html").text


def test_scenes_on_the_earth_show_coordinates(tmp_path):
    """Hovers tell latitude and longitude where a scene has an origin, of targets and of tracks."""
    from dataclasses import replace

    from assoc.plotting.report import write_tracking_report
    from assoc.scene.geodesy import geodetic
    from assoc.tracking import MultiSensorTracker, track_scene

    scene = replace(simulate("three-radar", 2, scans=4), origin=(0.82, 0.15, 400.0))
    association = assoc.associate(scene)
    write_association_report(tmp_path / "a.html", association, scene)
    view = data_of(tmp_path / "a.html")["scans"][0]["view"]
    expected = np.degrees(geodetic(association.scans[0].positions, scene.origin)[:, :2])
    np.testing.assert_allclose(view["degrees"], expected, atol=1e-5)
    table, _ = track_scene(MultiSensorTracker.for_scene(scene), scene)
    write_tracking_report(tmp_path / "t.html", table.to_frame(), scene)
    first = data_of(tmp_path / "t.html")["tracks"][0]
    row = table.to_frame().query(f"track_id == {first['id']}").iloc[0]
    assert first["lat"][0] == pytest.approx(row["latitude"], abs=1e-5)
    assert first["lon"][0] == pytest.approx(row["longitude"], abs=1e-5)
    # elsewhere there are none
    write_association_report(tmp_path / "b.html", association, replace(scene, origin=None))
    assert "degrees" not in data_of(tmp_path / "b.html")["scans"][0]["view"]


def test_measurements_with_times_of_their_own_have_no_residuals(tmp_path):
    """The target was elsewhere when they were made: what is between them and its position is no error."""
    radars = simulate("rotating-radars", 0, aircraft=5, duration=8.0, interval=4.0)
    write_association_report(tmp_path / "p.html", assoc.associate(radars), radars, ["s.npz"] * radars.num_scans)
    views = [scan["view"] for scan in data_of(tmp_path / "p.html")["scans"]]
    assert len(views) == radars.num_scans and all(view["residuals"] is None for view in views)
