"""Biases of sensors, as programs print them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._cli.lines import print_lines
from assoc._cli.table import print_table

if TYPE_CHECKING:
    from assoc.registration import Registration


def print_biases(found: Registration) -> None:
    """Print a row for each bias, and what cannot be observed."""
    rows = [
        [row["sensor"], row["component"], f"{row['bias']:.4g}", f"{row['sigma']:.2g}", row["unit"]]
        + ["yes" if row["observed"] else "no"]
        for row in found.rows()
    ]
    headers = ["sensor", "component", "bias", "sigma", "unit", "observed"]
    print_table(headers, rows, left=("sensor", "component", "unit"))
    print()
    print_lines("\n".join([found.summary(), *found.advice()]))
