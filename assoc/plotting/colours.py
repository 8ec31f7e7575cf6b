"""Colours, markers and dashes that differ also for colour-blind readers and in greyscale.

References
----------
M. Okabe and K. Ito, Color universal design (2008). Things drawn together differ in lightness or in shape too.
"""

from __future__ import annotations

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
GREY = "#7F7F7F"

SERIES = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILION, BLACK)
"""Colours of series, in order; yellow is left out: too light for lines on white."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""matplotlib markers of sensors and series, in step with `SERIES`."""

DASHES = ("-", "--", "-.", (0, (5, 1, 1, 1, 1, 1)), (0, (3, 1)), (0, (8, 2)), ":")
"""matplotlib line styles, in step with `SERIES`."""


def colour(number: int) -> str:
    """Colour of series ``number``; they repeat after seven."""
    return SERIES[number % len(SERIES)]


def marker(number: int) -> str:
    """Marker of series ``number``."""
    return MARKERS[number % len(MARKERS)]
