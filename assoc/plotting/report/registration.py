"""The report of a registration: biases, unobservable parameters, residuals before and after."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._system.door import door
from assoc._text.html import escape
from assoc.plotting.report.page import Page, cards, definitions, made_with, sortable_table
from assoc.plotting.report.plotly_script import check_report
from assoc.plotting.report.views import plain_numbers
from assoc.plotting.residuals import residual_columns
from assoc.registration import Registration
from assoc.registration.terms import label_of
from assoc.sensors.base import ANGLES

_COMPONENTS = ("range", "azimuth", "elevation", "x", "y", "z")
_MOST_SHOWN = 4_000


@door
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
    shown = [component for component in _COMPONENTS if residual_columns(registration, component)]
    plots = "".join(f'<div id="residuals-{component}" class="plot small"></div>' for component in shown)
    note = (
        '<p class="note">Each measurement against the position that fits its tuple best. A box holds the middle half, '
        "its line is the median; the dotted lines are the sensor's own noise, 95 %.</p>"
    )
    lead = f"{registration.tuples:,} targets seen in single scans by two or more of {len(registration.sensors)} sensors"
    Page(
        title=f"Registration of {name}" if name else "Registration",
        lead=lead,
        sections=[
            ("summary", "Summary", _summary(registration)),
            ("biases", "Biases", _table(registration)),
            ("residuals", "Residuals before and after", note + plots),
            ("made", "Made with", definitions(made_with("assoc.register", words))),
        ],
        data={"residuals": [_boxes(registration, component) for component in shown]},
        scripts=["registration.js"],
    ).write(path)


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


def _table(registration: Registration) -> str:
    headers = ["sensor", "component", "unit", "bias", "sigma", "observed"]
    rows = []
    for row in registration.rows():
        cells: list[tuple[str, Any]] = [(str(row[name]), row[name]) for name in headers[:3]]
        cells += [(f"{row[name]:.4g}", row[name]) for name in headers[3:5]]
        rows.append([*cells, ("yes" if row["observed"] else "no", str(row["observed"]))])
    return sortable_table("bias-table", headers, rows)


def _boxes(registration: Registration, component: str) -> dict[str, Any]:
    scale, unit = (float(np.degrees(1.0)), "deg") if component in ANGLES else (1.0, "m")
    sensors = []
    for s, i in residual_columns(registration, component):
        residuals = registration.residuals[s]
        step = max(1, len(residuals.before) // _MOST_SHOWN)
        sensors.append(
            {
                "name": label_of(registration.sensors, s),
                "limit": 1.96 * scale * float(np.sqrt(registration.sensors[s].covariance[i, i])),
                "before": plain_numbers(scale * residuals.before[::step, i], 5),
                "after": plain_numbers(scale * residuals.after[::step, i], 5),
            }
        )
    return {"component": component, "unit": unit, "sensors": sensors}
