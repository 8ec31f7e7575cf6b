"""Results of registration: biases, their covariance and observability, and residuals."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_json
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.registration.correction import biases_of_sensors, without_biases
from assoc.registration.terms import Term, label_of
from assoc.scene.scene import Scene
from assoc.sensors import Sensor

if TYPE_CHECKING:
    import pandas as pd

OBSERVED = 0.5
"""A bias, or a sum of biases, counts as observed when its standard deviation is below this share of its spread."""
SIGNIFICANCE = 0.01
"""Probability of finding biases where there are none."""
_SHARE = 0.2
_MOST_NAMED = 4

_SAID = {
    "range": ("ranges are", "long", "short"),
    "gain": ("ranges are", "long", "short"),
    "bearing": ("bearings are", "far clockwise", "far counter-clockwise"),
    "elevation": ("elevations are", "high", "low"),
    "time": ("times are", "late", "early"),
    "x": ("x (east) is", "large", "small"),
    "y": ("y (north) is", "large", "small"),
    "z": ("z (up) is", "large", "small"),
}
"""What a bias is of, and what it is above and below zero."""


@dataclass(frozen=True)
class Residuals:
    """Residuals of the measurements of one sensor from the positions of their tuples.

    Attributes
    ----------
    time : array (n,)
        Seconds.
    before, after : arrays (n, d)
        Metres and radians, with and without the biases.
    """

    time: Array
    before: Array
    after: Array


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Registration(Shown):
    """Biases of sensors: stated less true values.

    Attributes
    ----------
    sensors : tuple of Sensor
        As they were stated.
    terms : tuple of Term
        Sensor and component of each bias.
    biases : array (n,)
        Metres, radians, seconds.
    covariance : array (n, n)
        Of the biases; valid even if the sensors' stated noise is wrong.
    spreads : array (n,)
        Standard deviations assumed before.
    information : array (n, n)
        That of the measurements alone.
    tuples : int
        Targets found in single scans by two or more sensors, all scans together.
    skipped : int
        Scans passed over because they had too many candidate tuples.
    noise : float
        Residuals after, as a multiple of those expected from the sensors' noise; NaN without tuples.
    residuals : tuple over sensors of Residuals
    """

    sensors: tuple[Sensor, ...]
    terms: tuple[Term, ...]
    biases: Array
    covariance: Array
    spreads: Array
    information: Array
    tuples: int
    skipped: int
    noise: float
    residuals: tuple[Residuals, ...]

    @property
    def deviations(self) -> Array:
        """Standard deviations of the biases, (n,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @cached_property
    def observed(self) -> Array:
        """Which biases are observed, bool (n,)."""
        return np.asarray(observed_shares(self.information, self.spreads) < OBSERVED)

    @cached_property
    def open(self) -> tuple[str, ...]:
        """Sums of biases that are not observable, in words."""
        directions = open_directions(self.information, self.spreads)
        return tuple(describe(direction, self.terms, self.sensors) for direction in directions)

    @property
    def significant(self) -> bool:
        """Whether any bias is significant: a false positive has probability 0.01."""
        return is_significant(self.biases, self.covariance)

    def of(self, sensor: int) -> dict[str, float]:
        """Biases of one sensor by component; metres, radians, seconds."""
        if not 0 <= sensor < len(self.sensors):
            raise InvalidInputError(f"sensor {sensor} does not exist, there are 0 to {len(self.sensors) - 1}")
        return biases_of_sensors(self.sensors, self.terms, self.biases)[sensor]

    def correct(self, scene: Scene) -> Scene:
        """Take the biases off a scene of the same sensors; unchanged if none is significant.

        Raises
        ------
        InvalidInputError
            It has other sensors.
        """
        if scene.sensors != self.sensors:
            raise InvalidInputError("scene: its sensors are not those that were registered")
        if not self.significant:
            return scene
        velocities = None
        if any(term.component == "time" for term in self.terms):
            from assoc.registration.epochs import scene_velocities

            velocities = scene_velocities(scene)
        return without_biases(scene, [self.of(s) for s in range(len(self.sensors))], velocities)

    def to_frame(self) -> pd.DataFrame:
        """Return a table: sensor, component, unit, bias, sigma, observed; bearings in degrees, clockwise positive."""
        import pandas as pd

        return pd.DataFrame(self.rows())

    def rows(self) -> list[dict[str, Any]]:
        """Return a dictionary for each bias, as people say it: bearings in degrees, clockwise positive."""
        values = zip(self.terms, self.biases.tolist(), self.deviations.tolist(), self.observed.tolist(), strict=True)
        return [
            {
                "sensor": label_of(self.sensors, term.sensor),
                "component": term.shown,
                "unit": term.shown_unit,
                "bias": term.scale * bias,
                "sigma": abs(term.scale) * sigma,
                "observed": observed,
            }
            for term, bias, sigma, observed in values
        ]

    def advice(self) -> list[str]:
        """Say what to do about observed biases beyond three standard deviations, a line for each sensor."""
        found: dict[str, list[str]] = {}
        for row in self.rows() if self.significant else []:
            if row["observed"] and abs(row["bias"]) > 3.0 * row["sigma"]:
                what, more, less = _SAID[row["component"]]
                amount = f"{abs(row['bias']):.3g} {row['unit']}"
                wrong, do = (more, "subtract") if row["bias"] > 0 else (less, "add")
                found.setdefault(row["sensor"], []).append(f"{what} {amount} too {wrong}, {do} {amount}")
        return [f"{sensor}: {'; '.join(parts)}" for sensor, parts in found.items()]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a JSON file."""
        scales = np.array([term.scale for term in self.terms])
        return {
            "format": "assoc.registration",
            "version": 2,
            "biases": self.rows(),
            "covariance": (self.covariance * np.outer(scales, scales)).tolist(),
            "open": list(self.open),
            "significant": self.significant,
            "tuples": self.tuples,
            "scans_passed_over": self.skipped,
            "noise": self.noise if math.isfinite(self.noise) else None,
        }

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the biases as JSON: bearings in degrees, clockwise positive (azimuths before version 2)."""
        write_json(path, self.to_dict())

    def summary(self) -> str:
        """Return the results in a few lines."""
        lines = [
            f"{len(self.terms)} biases from {self.tuples} tuples; residuals are {self.noise:.3g} times those expected "
            "from the sensors' noise"
        ]
        if not self.tuples:
            lines = ["no two sensors have a target in common: no bias is observable"]
        elif not self.significant:
            lines.append("no bias is significant: measurements stay unchanged")
        lines += [f"not observable: {names}" for names in self.open] if self.tuples else []
        if self.skipped:
            lines.append(f"{self.skipped} scans had too many candidate tuples and were passed over")
        if self.tuples and self.noise > 1.5:
            lines.append("the residuals are larger than the noise: biases of other components, or noise understated")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Registration({len(self.terms)} biases of {len(self.sensors)} sensors, {self.tuples} tuples)"


def is_significant(biases: Array, covariance: Array) -> bool:
    """Whether biases (n,) are larger together than chance makes them with probability `SIGNIFICANCE`."""
    from scipy.special import gammaincc

    square = float(biases @ np.linalg.solve(covariance, biases))
    return float(gammaincc(len(biases) / 2.0, square / 2.0)) < SIGNIFICANCE


def noise_factor(chi: Array, freedom: Array) -> float:
    """Residuals as a multiple of those expected, by the median because of outliers."""
    good = freedom > 0
    if not good.any():
        return math.nan
    from scipy.special import gammaincinv

    middle = 2.0 * gammaincinv(freedom[good] / 2.0, 0.5)
    return float(np.sqrt(np.median(chi[good] / middle)))


def observed_shares(information: Array, spreads: Array) -> Array:
    """Share of each bias's spread that is left after the measurements, (n,): 1 if they have no information on it."""
    scaled = information * np.outer(spreads, spreads)
    left: Array = np.sqrt(np.diagonal(np.linalg.inv(scaled + np.eye(len(spreads)))))
    return left


def open_directions(information: Array, spreads: Array) -> Array:
    """Sums of biases that are not observable, (m, n) with rows of length one, in spreads of each bias.

    References
    ----------
    Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9; S. Blackman, R. Popoli, Design and
    Analysis of Modern Tracking Systems, 1999, section 10.5.
    """
    scaled = information * np.outer(spreads, spreads)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    found: Array = vectors[:, 1.0 / np.sqrt(1.0 + np.maximum(values, 0.0)) > OBSERVED].T
    if len(found) < 2:
        return found
    # any combination of them is open too: those of few biases are easiest to read
    from scipy.linalg import qr

    _, upper, order = qr(found, pivoting=True)
    few = np.zeros_like(found)
    few[:, order] = np.linalg.solve(upper[:, : len(found)], upper)
    shortened: Array = few / np.linalg.norm(few, axis=1, keepdims=True)
    return shortened


def describe(direction: Array, terms: Sequence[Term], sensors: Sequence[Sensor]) -> str:
    """Name the biases that move together in a direction that is not observable."""
    order = np.argsort(-np.abs(direction), kind="stable")
    # the shift of very many sensors together has small parts only
    share = min(_SHARE, 0.5 * float(np.abs(direction).max()))
    order = order[np.abs(direction[order]) > share]
    signs = np.sign(direction) * np.sign([term.scale for term in terms])
    parts = []
    for number in order[:_MOST_NAMED]:
        term, sign = terms[number], signs[order[0]] * signs[number]
        parts.append(f"{'+' if sign > 0 else '-'} {term.shown} of {label_of(sensors, term.sensor)}")
    text = " ".join(parts).removeprefix("+ ")
    return text + (" ..." if len(order) > _MOST_NAMED else "")
