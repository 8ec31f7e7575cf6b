"""The biases that are looked for, in the order in which vectors and matrices hold them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.several import NO_HEIGHT
from assoc.registration.parameters import RegistrationParameters
from assoc.sensors import BearingSensor, PositionSensor, Radar3D, Sensor
from assoc.sensors.base import ANGLES
from assoc.sensors.codes import CODES

AXES = ("x", "y", "z")
MEASURED, SITE, TIME, GAIN = 0, 1, 2, 3
"""Kinds of terms in kernels: a measured component, the position along an axis, the clock, the scale of ranges."""


class Term(NamedTuple):
    """One bias: stated less true value."""

    sensor: int
    """Number of the sensor, from 0."""
    component: str
    """range, gain, azimuth, elevation, time, or x, y, z."""

    @property
    def unit(self) -> str:
        """m, rad, s, or m/m of a gain."""
        return "rad" if self.component in ANGLES else {"time": "s", "gain": "m/m"}.get(self.component, "m")

    @property
    def shown(self) -> str:
        """The component for people, who read azimuths off a compass: "bearing", clockwise."""
        return "bearing" if self.component == "azimuth" else self.component

    @property
    def shown_unit(self) -> str:
        """m, deg, s or m/km, for people."""
        return "deg" if self.component in ANGLES else "m/km" if self.component == "gain" else self.unit

    @property
    def scale(self) -> float:
        """Factor from `unit` to `shown_unit`; below 0 for azimuths, which become bearings."""
        if self.component in ANGLES:
            return math.degrees(-1.0 if self.component == "azimuth" else 1.0)
        return 1e3 if self.component == "gain" else 1.0


def label_of(sensors: Sequence[Sensor], number: int) -> str:
    """Name of a sensor, or its number from 1."""
    return sensors[number].name or f"sensor {number + 1}"


def owners(sensors: Sequence[Sensor]) -> list[int]:
    """Whose biases each sensor has: a radar's plots without heights those of its plots with heights."""
    names = [sensor.name for sensor in sensors]
    stems = [name.removesuffix(NO_HEIGHT) for name in names]
    return [names.index(stem) if stem != name and stem in names else s
            for s, (stem, name) in enumerate(zip(stems, names, strict=True))]  # fmt: skip


def make_terms(sensors: Sequence[Sensor], parameters: RegistrationParameters) -> tuple[Term, ...]:
    """List the biases of sensors that parameters name; refused if a reference is no sensor, or nothing is left."""
    known = [{sensor.name, str(s + 1)} - {""} for s, sensor in enumerate(sensors)]
    for name in parameters.reference:
        if not any(name in names for names in known):
            every = ", ".join(label_of(sensors, s) for s in range(len(sensors)))
            raise InvalidInputError(f"reference: no sensor {name!r}; there are {every}")
    terms, owner = [], owners(sensors)
    for s, sensor in enumerate(sensors):
        if type(sensor) not in CODES:
            raise InvalidInputError(f"sensor {s}: biases of a {type(sensor).__name__} cannot be registered")
        if isinstance(sensor, PositionSensor) and sensor.platform is not None and sensor.platform.headings is not None:
            raise InvalidInputError(
                f"sensor {s}: positions relative to a platform with headings cannot be registered, those in the axes "
                "of the scene can"
            )
        if owner[s] == s and not known[s] & {*parameters.reference}:
            terms += [Term(s, component) for component in _components(sensor, parameters.components)]
    if not terms:
        raise InvalidInputError("components: no sensor has a bias to estimate")
    return tuple(terms)


def _components(sensor: Sensor, wanted: Sequence[str]) -> list[str]:
    if isinstance(sensor, PositionSensor):
        found = list(AXES[: sensor.dim])
    else:
        found = [name for name in sensor.components[:3] if name in wanted]
        if "gain" in wanted and "range" in sensor.components:
            found.append("gain")
        if "position" in wanted:
            found += AXES if isinstance(sensor, Radar3D) else AXES[:2]
    # bearings have no information on motion; a platform's own motion would have to be known by the same clock
    if "time" in wanted and not isinstance(sensor, BearingSensor) and sensor.platform is None:
        found.append("time")
    return found


class TermArrays(NamedTuple):
    """Terms in the form that kernels take."""

    sensor: Array
    """int64 (n,)."""
    kind: Array
    """MEASURED, SITE, TIME or GAIN, int64 (n,)."""
    entry: Array
    """Component of the measurement, or axis, int64 (n,)."""


def term_arrays(terms: Sequence[Term], sensors: Sequence[Sensor]) -> TermArrays:
    """Terms as flat arrays."""
    kind, index = [], []
    for term in terms:
        if term.component == "time":
            kind.append(TIME)
            index.append(0)
        elif term.component == "gain":
            kind.append(GAIN)
            index.append(0)
        elif term.component in AXES:
            kind.append(SITE)
            index.append(AXES.index(term.component))
        else:
            kind.append(MEASURED)
            index.append(sensors[term.sensor].components.index(term.component))
    return TermArrays(*(np.array(x, dtype=np.int64) for x in ([t.sensor for t in terms], kind, index)))
