"""What a report holds, read again: its tags and texts, and the figures that its script draws."""

import json
import re
from html.parser import HTMLParser

EVIL = "<script>alert(1)</script>"


def figures_of(path):
    """Each figure by the id of its element: data, layout, and frames if it has a slider."""
    page, decoder, found = path.read_text(), json.JSONDecoder(), {}
    for one in re.finditer(r'Plotly\.newPlot\(\s*"([^"]+)",\s*', page):
        data, end = decoder.raw_decode(page, one.end())
        layout, end = decoder.raw_decode(page, re.compile(r",\s*").match(page, end).end())
        found[one[1]] = {"data": data, "layout": layout, "frames": []}
    for one in re.finditer(r"Plotly\.addFrames\('([^']+)', ", page):
        found[one[1]]["frames"] = decoder.raw_decode(page, one.end())[0]
    return found


def named(traces, name):
    """The only one of traces with a name."""
    (found,) = (trace for trace in traces if trace.get("name") == name)
    return found


def step_of(figure, number, name):
    """The trace of a name at a position of the slider."""
    frame = figure["frames"][number]
    (at,) = (i for i, trace in zip(frame["traces"], frame["data"], strict=True) if figure["data"][i]["name"] == name)
    return frame["data"][frame["traces"].index(at)]


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


def text_of(path):
    return " ".join(parsed(path).text)
