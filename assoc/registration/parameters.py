"""Parameters of registration."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from assoc._parameters import Parameters
from assoc.errors import InvalidInputError

COMPONENTS = ("range", "azimuth", "elevation", "gain", "time", "position")
"""Biases that can be estimated."""


@dataclass(frozen=True)
class RegistrationParameters(Parameters):
    """Which biases are estimated, and how large they may be.

    Spreads are prior standard deviations: biases of up to about two of them are found. Wider ones find larger biases,
    and confuse targets that fly close together.

    Attributes
    ----------
    components : tuple of str
        Of `COMPONENTS`; those that a sensor does not measure are ignored. "gain" is an error of ranges in proportion
        to the range (the speed of the pulse, its extra way through the air). "position" is an error of a sensor's
        stated position; sensors that report positions are always estimated in x, y (and z).
    reference : tuple of str
        Names of sensors without bias (or their numbers from 1).
    range_spread, angle_spread, gain_spread, time_spread, position_spread : float
        Metres, radians, metres per metre, seconds, metres.
    max_tuples : int
        Scans with more candidate tuples are passed over.
    seed : int
        Of the solver's randomness.
    """

    components: tuple[str, ...] = ("range", "azimuth", "elevation")
    reference: tuple[str, ...] = ()
    range_spread: float = 300.0
    angle_spread: float = math.radians(0.3)
    gain_spread: float = 0.001
    time_spread: float = 1.0
    position_spread: float = 300.0
    max_tuples: int = 200_000
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("components", "reference"):
            value = getattr(self, name)
            many = isinstance(value, Iterable) and not isinstance(value, str)
            if not many or not all(isinstance(entry, str) for entry in value):
                raise InvalidInputError(f"{name}: expected names, got {value!r}")
            object.__setattr__(self, name, tuple(value))
        for component in self.components:
            if component not in COMPONENTS:
                raise InvalidInputError(f"components: unknown {component!r}; known: {', '.join(COMPONENTS)}")
        self._number("range_spread", "angle_spread", "gain_spread", "time_spread", "position_spread", above=0.0)
        self._whole("max_tuples")
        self._whole("seed", least=0)

    def spread(self, component: str) -> float:
        """Standard deviation of the biases of a component: range, gain, azimuth, elevation, time, x, y or z."""
        named = {"range": self.range_spread, "gain": self.gain_spread, "time": self.time_spread}
        if component in ("azimuth", "elevation"):
            return self.angle_spread
        return named.get(component, self.position_spread)
