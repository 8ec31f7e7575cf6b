"""What was declared of sensors and targets against what a tracker has seen, for people."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from assoc._system.imports import removed_attribute
from assoc._types import Array
from assoc.costs.tracks.unresolved import resolutions
from assoc.costs.views import BANDS, reach
from assoc.sensors import Sensor
from assoc.tracking.adapting.folding import assumed_folding
from assoc.tracking.records.biases import CLOCK, Biases
from assoc.tracking.records.echoes import AZIMUTH, RANGE
from assoc.tracking.records.estimates import ALARMS, DETECTION, NOISE, Estimates, declared_values
from assoc.tracking.records.unresolved import Unresolved
from assoc.tracking.target_kinds import TARGETS

_WIDTH = 1.96
# so many times slower or faster than the prior of speeds is worth a word
_SLOWER, _FASTER = 15.0, 3.0
# of a clock, seconds, that is worth a word
_LATE = 0.02
# differences smaller than this share are not worth a word, nor those within so many standard deviations
_SMALL, _UNSURE = 0.1, 3.0
_WORDS = {2.0: "twice", 3.0: "three times", 4.0: "four times", 0.5: "half", 1 / 3: "a third of", 0.25: "a quarter of"}


@dataclass(frozen=True)
class Quantity:
    """A quantity as declared and as seen.

    Attributes
    ----------
    declared, seen : float
    low, high : float
        Interval of 95 %, the prior at what was declared included.
    """

    declared: float
    seen: float
    low: float
    high: float

    @property
    def differs(self) -> bool:
        """Whether what was seen is surely and noticeably not as declared."""
        # the interval is symmetric on its scale: wider by this factor it must not contain what was declared
        wide = _UNSURE / _WIDTH
        low, high = self.seen * (self.low / self.seen) ** wide, self.seen * (self.high / self.seen) ** wide
        return not low <= self.declared <= high and abs(self.seen / self.declared - 1.0) > _SMALL

    def __format__(self, kind: str) -> str:
        kind = kind if self.high < 10.0 else ".3g"
        return f"{self.seen:{kind}} ({self.low:{kind}}-{self.high:{kind}})"


@dataclass(frozen=True)
class SensorHealth:
    """A sensor as declared and as seen.

    Attributes
    ----------
    name : str
    noise : Quantity
        Standard deviations relative to those declared.
    detection_probability, false_alarm_rate : Quantity
    by_range : tuple of (float, Quantity)
        Ends of bands of range (m) with targets in them, and the detection probability there; declared is what was seen
        at all ranges.
    folding : float or None
        Interval, m/s, at which range rates are taken to fold though nobody said so.
    ghosts : tuple of int
        Tracks so far that were echoes of others rather than targets, and were not shown: at another one's range (side
        lobes), at its azimuth behind it (multipath).
    verdict : str
    """

    name: str
    noise: Quantity
    detection_probability: Quantity
    false_alarm_rate: Quantity
    by_range: tuple[tuple[float, Quantity], ...] = ()
    folding: float | None = None
    ghosts: tuple[int, int] = (0, 0)
    merges: str = ""
    """Within what two targets give one plot, though nobody said so."""
    biases: str = ""
    """What measurements, and the clock, are corrected for."""
    places: float = 0.0
    """Plots a scan that come from places of clutter, as wind farms and shores are: no part of the false alarms."""

    @property
    def verdict(self) -> str:
        """What is not as declared, in words."""
        noise, seen, alarms = self.noise, self.detection_probability, self.false_alarm_rate
        found = [
            *([f"noise about {_times(noise.seen)} the declared"] if noise.differs else []),
            *([f"detects {seen.seen:.0%} of targets, declared {seen.declared:.0%}"] if seen.differs else []),
            *([self._ranges] if any(band.differs for _, band in self.by_range) else []),
            *([f"{alarms.seen:.3g} false alarms a scan, declared {alarms.declared:.3g}"] if alarms.differs else []),
        ]
        if self.places > _SMALL * alarms.seen:
            found.append(f"{self.places:.3g} more a scan from places of clutter, which tracks are kept from")
        if any(self.ghosts):
            found.append(f"ghosts: {self.ghosts[0]} tracks by side lobes, {self.ghosts[1]} by multipath, not shown")
        if self.biases:
            found.append(f"corrected by tracks that others see, too: {self.biases}")
        if self.merges:
            found.append(f"unresolved: targets within {self.merges} give one plot (resolution=)")
        if self.folding is not None:
            found.append(f"range rates taken to fold at {self.folding:g} m/s (folding= says, inf: they do not)")
        return "; ".join(found) or "as declared"

    @property
    def _ranges(self) -> str:
        return "by range " + ", ".join(f"{band.seen:.0%} up to {end / 1e3:.3g} km" for end, band in self.by_range)


@dataclass(frozen=True)
class Health:
    """Sensors and targets as declared and as seen; `str` is a table for people.

    Attributes
    ----------
    sensors : tuple of SensorHealth
    manoeuvres : Quantity
        Process noise of the filter, of its most agile model, relative to that declared.
    """

    sensors: tuple[SensorHealth, ...]
    manoeuvres: Quantity
    speed: str = ""
    """What the prior of speeds has to do with the tracks, where it does not suit them."""
    extent: str = ""
    """How many targets return several plots, and how long they are."""

    if not TYPE_CHECKING:
        __getattr__ = removed_attribute

    @property
    def verdicts(self) -> tuple[str, ...]:
        """One line for each sensor, and one for the targets."""
        agile = self.manoeuvres.differs and self.manoeuvres.seen > 1.0
        targets = (
            f"manoeuvre about {_times(self.manoeuvres.seen)} as hard as the filter expects"
            if agile
            else ("no harder manoeuvres than the filter expects")
        )
        sensors = (f"{sensor.name}: {sensor.verdict}" for sensor in self.sensors)
        return (*sensors, "; ".join([f"targets: {targets}", *filter(None, (self.extent, self.speed))]))

    def __str__(self) -> str:
        rows: list[tuple[str, ...]] = [("sensor", "noise/declared", "P_d (%)", "decl.", "false alarms", "decl.")]
        for sensor in self.sensors:
            seen, alarms = sensor.detection_probability, sensor.false_alarm_rate
            share = f"{100 * seen.seen:.0f} ({100 * seen.low:.0f}-{100 * seen.high:.0f})"
            declared = f"{100 * seen.declared:.3g}", f"{alarms:.2f}", f"{alarms.declared:.3g}"
            rows.append((sensor.name[:16], f"{sensor.noise:.2f}", share, *declared))
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        lines = ["  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
        return "\n".join([*lines, *self.verdicts])


def _times(factor: float) -> str:
    for known, words in _WORDS.items():
        if abs(factor / known - 1.0) < _SMALL:
            return words
    return f"{factor:.2g} times"


def health(
    sensors: Sequence[Sensor],
    estimates: Estimates,
    speed: float | Sequence[float],
    ghosts: Array,
    flown: float,
    unresolved: Unresolved,
    biases: Biases | None,
    lengths: Sequence[float] = (),
    places: Sequence[float] | None = None,
) -> Health:
    """Compare estimates with what was declared of these sensors.

    `speed`, m/s, is that of `assoc.tracking.Initiation`, `flown` that of the tracks, 0 where none is known;
    `ghosts` (S, 2) are tracks that were echoes (`assoc.tracking.records.echoes`), `unresolved` says what was learnt of
    resolutions, `biases` what measurements are corrected for; `lengths` (m) are those of targets with several plots,
    `places` (S,) plots a scan from places of clutter.
    """
    values, spreads = estimates.found_and_spreads(sensors)
    declared, (by_range, weights) = declared_values(sensors), estimates.by_range(values[:, DETECTION])
    unsure = np.sqrt(np.diagonal(np.linalg.inv(weights), axis1=1, axis2=2))
    rows = []
    for s, sensor in enumerate(sensors):
        noise, P, alarms = (
            _quantity(declared[s, c], values[s, c], spreads[s, c], c) for c in (NOISE, DETECTION, ALARMS)
        )
        bands = [
            ((b + 1) * reach(sensor) / BANDS, _quantity(values[s, DETECTION], by_range[s, b], unsure[s, b], DETECTION))
            for b in (np.flatnonzero(estimates.dwells[s] >= 1.0).tolist() if reach(sensor) else ())
        ]
        folding, hidden = assumed_folding(sensor, speed), (int(ghosts[s, RANGE]), int(ghosts[s, AZIMUTH]))
        rows.append(
            SensorHealth(
                sensor.name or f"sensor {s + 1}",
                noise,
                P,
                alarms,
                tuple(bands),
                folding,
                hidden,
                _merges(s, sensor, unresolved),
                "" if biases is None or not biases.used.any() else _off(sensor, biases.of(sensors)[s]),
                0.0 if places is None else places[s],
            )
        )
    manoeuvres = _quantity(1.0, *estimates.agile, NOISE)
    return Health(tuple(rows), manoeuvres, _of_speed(float(np.max(speed)), flown), _of_extent(lengths))


def _of_extent(lengths: Sequence[float]) -> str:
    """See `Health.extent`; nothing where all targets return one plot."""
    if not len(lengths):
        return ""
    return f"{len(lengths)} with several plots each, {min(lengths):.2g} to {max(lengths):.2g} m long"


def _merges(s: int, sensor: Sensor, unresolved: Unresolved) -> str:
    """See `SensorHealth.merges`; nothing where the resolution was said, or is rather none."""
    likeliest = int(np.argmax(unresolved.weights(s)))
    if sensor.resolution is not None or not likeliest:
        return ""
    parts = zip(sensor.components[: sensor.dim], resolutions(sensor)[likeliest].tolist(), strict=True)
    texts = [_value(name, value) for name, value in parts if math.isfinite(value)]
    return " and ".join(texts)


def _off(sensor: Sensor, biases: Mapping[str, float]) -> str:
    """See `SensorHealth.biases`: those that are noticeable beside the noise, and the clock's."""
    part, late = sensor.position_part, biases[CLOCK]
    noise = zip(part.components[: part.dim], np.sqrt(np.diagonal(part.covariance)).tolist(), strict=True)
    texts = [_value(name, biases[name]) for name, unit in noise if abs(biases[name]) > _SMALL * unit]
    if abs(late) > _LATE:
        texts.append(f"clock {abs(late):.2g} s {'late' if late > 0 else 'early'}")
    return ", ".join(texts)


def _value(name: str, value: float) -> str:
    text = f"{math.degrees(value):.2g} deg" if name in ("azimuth", "elevation") else f"{value:.2g} m"
    return f"{name} {text}"


def _of_speed(prior: float, flown: float) -> str:
    """What a prior of speeds that does not suit targets of this speed is to be replaced by; nothing if it does."""
    if not flown or prior / _SLOWER < flown < _FASTER * prior:
        return ""
    kind = min(TARGETS, key=lambda name: abs(math.log(TARGETS[name].speed / flown)))
    slower = "faster" if flown > prior else "slower"
    return f"targets look {slower} than assumed: --targets {kind} (about {flown:.2g} m/s, assumed {prior:.3g})"


def _quantity(declared: float, seen: float, spread: float, column: int) -> Quantity:
    """A quantity whose logarithm (of a probability: of its odds) has this deviation."""
    factors = np.exp([-_WIDTH * spread, _WIDTH * spread])
    if column == DETECTION:
        low, high = (seen * factor / (1.0 - seen + seen * factor) for factor in factors.tolist())
    else:
        low, high = (seen * factor for factor in factors.tolist())
    # variances were estimated
    root = 0.5 if column == NOISE else 1.0
    return Quantity(*(float(value) ** root for value in (declared, seen, low, high)))
