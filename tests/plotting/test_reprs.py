"""What notebooks show of the four things, and that names in it are only text."""

from html.parser import HTMLParser

import numpy as np
import pytest

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


def test_names_are_only_text():
    name = "<script>alert(1)</script>"
    sensor = Radar3D(position=(0, 0, 0), noise=(1, 1e-3, 1e-3), field_of_view=[[0, 9], [-3, 3], [0, 1]], name=name)
    found = Strict(Scene([sensor], [0.0], [[np.zeros((0, 3))]], name=name)._repr_html_())
    assert "script" not in found.tags and found.text.count(name) >= 2


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
