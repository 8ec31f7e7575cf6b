"""What notebooks show of the four things, and that names in it are only text."""

from html.parser import HTMLParser

import numpy as np
import pytest

import assoc
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.simulation import simulate


class Strict(HTMLParser):
    """Checks that every element is closed in order, and collects text and tags."""

    def __init__(self, text):
        super().__init__()
        self.stack, self.text, self.tags = [], "", set()
        self.feed(text)
        assert self.stack == []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag != "br":
            self.stack.append(tag)

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        self.text += data + " "


@pytest.fixture(scope="module")
def scene():
    return simulate("three-radar", 2, scans=12)


def test_each_shows_its_figures(scene):
    association = assoc.associate(scene, "exact")
    problem, solution = assoc.build_problem(scene, 0), association.solutions[0]
    shown = Strict(scene._repr_html_()).text
    assert "radar 2" in shown and "Radar3D" in shown and "azimuth 0.0573°" in shown
    shown = Strict(problem._repr_html_()).text
    for count in (1, 2, 3):
        assert f" {count} {(np.count_nonzero(problem.tuples, axis=1) == count).sum()} " in shown
    shown = Strict(solution._repr_html_()).text
    assert f"{solution.cost:.6g}" in shown and "optimal" in shown and solution.solver in shown
    shown = Strict(association._repr_html_()).text
    assert "12 scans" in shown and "... and 2 more scans" in shown and "3/3" in shown


def test_reprs_are_one_short_line(scene):
    association = assoc.associate(scene, "exact")
    things = [scene, scene.scan(0), scene.truth, assoc.build_problem(scene, 0), association.solutions[0]]
    for thing in [*things, association.scans[0], association]:
        assert repr(thing).startswith(type(thing).__name__ + "(") and "\n" not in repr(thing)
        assert len(repr(thing)) < 260


def test_names_are_only_text():
    name = "<script>alert(1)</script>"
    sensor = Radar3D(position=(0, 0, 0), noise=(1, 1e-3, 1e-3), field_of_view=[[0, 9], [-3, 3], [0, 1]], name=name)
    found = Strict(Scene([sensor], [0.0], [[np.zeros((0, 3))]], name=name)._repr_html_())
    assert "script" not in found.tags and found.text.count(name) >= 2


def test_empty_things_can_be_shown():
    problem = assoc.AssignmentProblem(np.zeros((0, 2), int), [], [0, 0])
    for thing in (problem, assoc.assign(problem), assoc.Association((), "exact")):
        Strict(thing._repr_html_())


def results(scene):
    """One of everything that calls answer with."""
    from assoc import metrics, recordings, simulation, solvers, sweeps, tracking
    from assoc.registration import register

    problem = assoc.build_problem(scene, 0)
    tracker = tracking.MultiSensorTracker.for_scene(scene)
    table, decisions = tracking.track_scene(tracker, scene)
    truth = metrics.Trajectories.from_scene(scene)
    plots = simulation.simulate_recording("rotating-radar", 0, aircraft=4, duration=40.0).recording
    windows = recordings.clustering_time_window(plots)
    number = np.repeat(np.arange(len(windows)), [len(window) for window in windows])
    known = plots.aircraft[np.concatenate([window.rows for window in windows])]
    return [
        scene, scene.truth, problem, assoc.assign(problem), assoc.associate(scene), assoc.associate(scene).scans[0],
        assoc.marginals(problem), table, decisions[0], tracker.tracks[0], truth, windows[0], plots,
        metrics.summarise(truth, metrics.Trajectories(*table.arrays()), 1000.0),
        metrics.ct_mt_it(number, known, known, known >= 0),
        sweeps.Study(scene, sweeps.grid("greedy", {})), solvers.pheromone(problem), register(scene),
    ]  # fmt: skip


def test_every_result_shows_itself(scene):
    for thing in results(scene):
        assert repr(thing).startswith(type(thing).__name__) and "\n" not in repr(thing) and len(repr(thing)) < 400
        if hasattr(thing, "_repr_html_"):
            assert type(thing).__name__ in Strict(thing._repr_html_()).text or "scans" in thing._repr_html_()
    assert sum(hasattr(thing, "_repr_html_") for thing in results(scene)) >= 15


def test_names_in_tables_of_results_are_text(scene):
    """A target's call sign, as read from a file, is in the table of tracks."""
    from assoc.tracking import TrackTable

    evil = "<script>alert(1)</script>"

    class Named(TrackTable):
        def to_frame(self):
            import pandas as pd

            return pd.DataFrame({"target": [evil], evil: [1.0]})

    shown = Named()._repr_html_()
    assert "<script" not in shown and "&lt;script&gt;" in shown
    assert Strict(shown).tags == {"p", "table", "thead", "tbody", "tr", "th", "td"}
