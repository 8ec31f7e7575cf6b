"""The report of a registration: biases, unobservable parameters, residuals before and after."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import escape
from assoc._types import Array
from assoc.plotting.colours import BLUE, GREY, ORANGE
from assoc.plotting.report.figures import layout
from assoc.plotting.report.page import Part, cards, check_report, note, settings_part, table, write_page
from assoc.registration import Registration
from assoc.registration.terms import label_of
from assoc.sensors.base import ANGLES

_COMPONENTS = ("range", "azimuth", "elevation", "x", "y", "z")


@explains_wrong_types
def write_registration_report(
    path: str | os.PathLike[str], registration: Registration, *, name: str = "", words: Sequence[str] | None = None
) -> None:
    """Write a registration as one HTML file that works without a network.

    Parameters
    ----------
    path : path-like
        The file to write; it appears whole or not at all.
    registration : Registration
    name : str
        Name of the scene, to be shown.
    words : sequence of str, optional
        The command line of ``python -m assoc.register`` that made it, to be shown.

    Raises
    ------
    MissingExtraError
        plotly is not installed.
    InvalidInputError
        The file cannot be written.
    """
    check_report()
    shown = [component for component in _COMPONENTS if _columns(registration, component)]
    about = note(
        "Each measurement against the position that fits its tuple best. A box holds the middle half, its line is the "
        "median, its whiskers 95 %; the grey marks are the sensor's own noise, 95 %."
    )
    lead = f"{registration.tuples:,} targets seen in single scans by two or more of {len(registration.sensors)} sensors"
    parts = [
        Part("Summary", _summary(registration)),
        Part("Biases", _biases(registration)),
        Part("Residuals before and after", about, [_boxes(registration, component) for component in shown]),
        settings_part("", "assoc.register", words),
    ]
    write_page(path, f"Registration of {name}" if name else "Registration", lead, parts)


def _columns(registration: Registration, component: str) -> list[tuple[int, int]]:
    """Sensors that measure a component, and its index among theirs."""
    return [
        (s, sensor.components.index(component))
        for s, sensor in enumerate(registration.sensors)
        if component in sensor.components[: sensor.position_part.dim]
    ]


def _summary(registration: Registration) -> str:
    observed = int(registration.observed.sum())
    noise = "-" if np.isnan(registration.noise) else f"{registration.noise:.3g}"
    found = cards(
        {
            "Biases": (f"{observed} of {len(registration.terms)}", "observed: known to less than half their spread"),
            "Significant": ("yes" if registration.significant else "no", "else measurements stay as they are"),
            "Residuals after": (noise, "of what the sensors' noise makes expect"),
        }
    )
    items = "".join(f"<li>{escape(line)}</li>" for line in registration.open)
    return found + (f"<p>Not observable, these sums of biases:</p><ul>{items}</ul>" if items else "")


def _biases(registration: Registration) -> str:
    headers = ["sensor", "component", "unit", "bias", "sigma", "observed"]
    rows = [
        [*(str(row[name]) for name in headers[:3]), f"{row['bias']:.4g}", f"{row['sigma']:.4g}",
         "yes" if row["observed"] else "no"]
        for row in registration.rows()
    ]  # fmt: skip
    return table(headers, rows)


def _boxes(registration: Registration, component: str) -> dict[str, Any]:
    scale, unit = (float(np.degrees(1.0)), "deg") if component in ANGLES else (1.0, "m")
    columns = _columns(registration, component)
    names = [escape(label_of(registration.sensors, s)) for s, _ in columns]
    data: list[dict[str, Any]] = []
    for when, colour in (("before", BLUE), ("after", ORANGE)):
        parts = [scale * getattr(registration.residuals[s], when)[:, i] for s, i in columns]
        ends = np.array([_quantiles(part) for part in parts]).T.tolist()
        keys = zip(("lowerfence", "q1", "median", "q3", "upperfence"), ends, strict=True)
        data.append({"type": "box", "name": when, "x": names, "marker": {"color": colour}, **dict(keys)})
    limits = [1.96 * scale * float(np.sqrt(registration.sensors[s].covariance[i, i])) for s, i in columns]
    for sign in (1.0, -1.0):
        marks = {"symbol": "line-ew", "size": 60, "line": {"width": 2, "color": GREY}}
        data.append(
            {"type": "scatter", "mode": "markers", "name": "noise, 95 %", "x": names, "y": [sign * y for y in limits],
             "marker": marks, "showlegend": False}
        )  # fmt: skip
    return {"data": data, "layout": layout("", f"residual of {component} ({unit})", boxmode="group")}


def _quantiles(values: Array) -> list[float | None]:
    return [None] * 5 if not len(values) else np.quantile(values, [0.025, 0.25, 0.5, 0.75, 0.975]).tolist()
