"""Figures as plotly takes them: layout, curves, a slider over steps."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from assoc._text.html import escape
from assoc._text.times import UNIX
from assoc._types import Array
from assoc.plotting.axes import Unit
from assoc.plotting.colours import BLACK, GREY, SERIES

MOST_STEPS = 300
"""Positions of a slider."""
BUDGET = 2_800_000
"""Limit on the bytes of all steps of a figure."""
FAINT = "#c8cdd2"

_DASHES = ("solid", "dash", "dashdot", "dot", "longdash", "longdashdot", "5px,1px")
_AXIS = {"zeroline": False, "gridcolor": "#e5e8eb", "linecolor": GREY, "ticks": "outside", "automargin": True}
_FONT = {"family": 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif', "size": 13}

Dicts = dict[str, Any]


def plain_numbers(values: Array | Sequence[float], decimals: int) -> list[Any]:
    """Nested lists of rounded numbers, integers if `decimals` is 0; None where not finite."""
    array = np.round(np.asarray(values, dtype=np.float64), decimals)
    if not np.isfinite(array).all():
        plain: Any = array.astype(object)
        plain[~np.isfinite(array)] = None
        return list(plain.tolist())
    if decimals <= 0 and array.size and np.abs(array).max() < 2**53:
        array = array.astype(np.int64)
    return array.tolist()


def layout(x: str, y: str, *, height: str = "low", **more: Any) -> Dicts:
    """Layout of a figure with these texts at its axes, low or high; `more` goes over it."""
    axes = {f"{axis}axis": {**_AXIS, "title": {"text": text}} for axis, text in (("x", x), ("y", y))}
    legend = {"orientation": "h", "x": 0, "yref": "container", "y": 0, "yanchor": "bottom", "font": {"size": 12}}
    base: Dicts = {
        "font": _FONT,
        "margin": {"l": 50, "r": 14, "t": 14, "b": 44},
        "hovermode": "closest",
        "meta": height,
    }
    base |= {"hoverlabel": {"align": "left", "font": {"size": 12}}, "legend": legend, "showlegend": True, **axes}
    for name, value in more.items():
        base[name] = {**base[name], **value} if isinstance(base.get(name), dict) else value
    return base


def scatter(name: str, mode: str = "markers", **more: Any) -> Dicts:
    """Trace of a name that may hold anything."""
    return {"type": "scatter", "mode": mode, "name": escape(name), **more}


def line(number: int) -> Dicts:
    """Colour and dash of a series."""
    return {"color": SERIES[number % len(SERIES)], "dash": _DASHES[number % len(_DASHES)], "width": 1.8}


def points(where: Array, unit: Unit) -> Dicts:
    """Coordinates x and y of positions (n, 2 or more), metres, for a trace; NaN ends a line."""
    where = np.asarray(where, dtype=float).reshape(-1, np.shape(where)[-1])
    known = np.abs(where[:, :2][np.isfinite(where[:, :2])])
    reach = float(known.max()) if known.size else 0.0
    decimals = (0 if reach > 20_000 else 1 if reach > 2_000 else 3) + (3 if unit.name == "km" else 0)
    x, y = (plain_numbers(unit.factor * where[:, axis], decimals) for axis in (0, 1))
    return {"x": x, "y": y}


def joined(parts: Iterable[Array]) -> Array:
    """Lines (n, 2 or more) one after another, a row of NaN after each."""
    return np.concatenate([np.zeros((0, 2)), *(row for part in parts for row in (part[:, :2], [[np.nan, np.nan]]))])


def plan(box: Array, unit: Unit) -> Dicts:
    """Layout of a map of a box (2, 2), metres, with equal scales."""
    x, y = (plain_numbers(unit.factor * side, 4) for side in box)
    return layout(
        f"x ({unit.name})",
        f"y ({unit.name})",
        height="high",
        xaxis={"range": x},
        yaxis={"range": y, "scaleanchor": "x"},
    )


def on_axis(times: Array | Sequence[float]) -> list[Any]:
    """Times as an axis takes them: seconds, and Unix times as dates in UTC."""
    array = np.asarray(times, dtype=float)
    if array.size and array[0] > UNIX:
        return [str(one) for one in np.round(1e3 * array).astype("datetime64[ms]")]
    return plain_numbers(array, 4)


def over_time(curves: Sequence[tuple[str, Array, Array]], label: str, decimals: int = 4) -> Dicts:
    """Figure of curves (name, times, values); the legend is left out where it would fill the figure."""
    data = [
        scatter(name, "lines", x=on_axis(times), y=plain_numbers(values, decimals), line=line(i))
        for i, (name, times, values) in enumerate(curves)
    ]
    dates = any(len(times) and times[0] > UNIX for _, times, _ in curves)
    shown = layout("time (UTC)" if dates else "time (s)", label, showlegend=1 < len(curves) <= 12)
    return {"data": data, "layout": shown | {"yaxis": shown["yaxis"] | {"rangemode": "tozero"}}}


def sliding(
    figure: Dicts, steps: Sequence[tuple[str, Sequence[Dicts]]], *, first: int = 0, last: bool = False
) -> Dicts:
    """Return the figure with a slider over steps: the text of each, and what its traces are from number `first` on.

    A step begins with what is drawn of it; `last`: the figure is at its last one.
    """
    if not steps:
        return figure
    at = len(steps) - 1 if last else 0
    traces = list(range(first, first + len(steps[0][1])))
    data = [*figure["data"]]
    for number, trace in zip(traces, steps[at][1], strict=True):
        data[number] = {**data[number], **trace}
    how = {"mode": "immediate", "frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    play = {**how, "frame": {"duration": 400, "redraw": True}, "fromcurrent": True}
    frames, marks = [], []
    for number, (text, changed) in enumerate(steps):
        kinds = [{"type": data[at]["type"], **trace} for at, trace in zip(traces, changed, strict=True)]
        frames.append({"name": str(number), "data": kinds, "traces": traces})
        marks.append({"method": "animate", "label": escape(text), "args": [[str(number)], how]})
    buttons = [("Play", [None, play]), ("Pause", [[None], how])]
    slider = {
        "active": at, "steps": marks, "x": 0.0, "len": 1.0, "y": 1.0, "yanchor": "bottom",
        "pad": {"b": 22, "t": 0},
        "ticklen": 0, "font": {"size": 1, "color": "rgba(0,0,0,0)"},
        "currentvalue": {"font": {"size": 12, "color": BLACK}, "xanchor": "left"},
    }  # fmt: skip
    player = {
        "type": "buttons", "direction": "left", "showactive": False, "x": 0.0, "xanchor": "left", "y": 1.0,
        "yanchor": "bottom", "pad": {"b": 78, "t": 0}, "font": {"size": 12},
        "buttons": [{"method": "animate", "label": text, "args": given} for text, given in buttons],
    }  # fmt: skip
    given = figure["layout"] if len(steps) > 1 else {**figure["layout"], "title": {"text": escape(steps[0][0])}}
    if len(steps) > 1:
        given = {**given, "sliders": [slider], "updatemenus": [player]}
    return {"data": data, "layout": given, "frames": frames}


def evenly(count: int, most: int = MOST_STEPS) -> list[int]:
    """Numbers below `count`, at most so many, evenly spaced."""
    return list(range(0, count, max(1, math.ceil(count / most))))


def within_budget(steps: list[Any], budget: int = BUDGET) -> list[Any]:
    """Every n-th step, so that they take no more bytes than the budget."""
    sizes = [len(json.dumps(step, separators=(",", ":"))) for step in steps]
    every = 1
    while every < len(sizes) and sum(sizes[::every]) > budget:
        every += 1
    return steps[::every]
