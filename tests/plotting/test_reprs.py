"""What notebooks show of the four things, and that names in it are only text."""

from __future__ import annotations

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
