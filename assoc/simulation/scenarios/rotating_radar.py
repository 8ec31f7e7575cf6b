"""Plots of one rotating air-surveillance radar: random traffic, or two aircraft that are hard to keep apart.

Made after the recording that G. P. Cahyono's thesis (Multitarget tracking using multiple hypothesis tracking with
clustering time window radar data, ITS Surabaya, 2014) describes and prints in part: ranges in whole nautical miles
up to 255, bearings in steps of 1440 / 4095 degrees, lost identities, garbled altitudes. The recording itself is
not public.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from assoc._parameters import Parameters, described
from assoc._system import memory
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.altitude import GARBLED_CODES, garbled_altitudes
from assoc.recordings.columns import FLIGHT_LEVEL, NAUTICAL_MILE
from assoc.recordings.recording import UNDECODED, Recording
from assoc.scene.geodesy import east_north_up, geodetic
from assoc.simulation.antenna import bearings_in_steps, dwells, in_steps, slant_range_and_bearing
from assoc.simulation.flights import STEP, Flight, random_flight

if TYPE_CHECKING:
    from assoc.metrics.trajectories import Trajectories

Traffic = Literal["random", "crossing", "parallel", "head-on"]

BEARING_STEP = 1440 / 4095
# bytes, measured (tests/reliability/test_memory.py): of a step of one path, of a plot
_STEP, _PLOT = 300, 250
TRAFFIC = (math.radians(47.0), math.radians(8.0), 0.0)
"""What aircraft fly around, seen by radars that have a place: latitude, longitude, height."""
PARALLEL_SEPARATION = 5.0
"""Nautical miles: what air traffic control keeps between aircraft en route."""


@dataclass(frozen=True)
class RotatingRadarParameters(Parameters):
    """Parameters of the rotating radar."""

    traffic: Traffic = described("random", "many aircraft at random, or a pair: crossing, parallel, head-on")
    aircraft: int | None = described(None, "number of aircraft of random traffic (default: 14)")
    duration: float = described(1130.0, "seconds")
    rotation: float = described(9.5, "seconds for a turn of the antenna")
    detection_probability: float = described(0.78, "P_d of a dwell")
    false_plots: float = described(2.5, "mean false plots in a rotation")
    identity_loss: float = described(0.05, "share of plots whose Mode 3 is lost (0)")
    garbled: float = described(0.1, "share of altitudes that are garbled")
    reach: float = described(255.0, "farthest range, nautical miles")
    range_step: float = described(1.0, "step of ranges, nautical miles (0: exact)")
    bearing_step: float = described(BEARING_STEP, "step of bearings, degrees (0: exact)")
    time_step: float = described(0.0, "stamps are cut to multiples of this, seconds (0: exact; the paper's are 1)")
    separation: float | None = described(
        None, "distance of a pair at its closest, nautical miles (default: 5 if parallel, else 0)"
    )
    latitude: float | None = described(
        None, "of the radar, degrees; aircraft fly around 47 N, 8 E (default: flat earth)"
    )
    longitude: float | None = described(None, "of the radar, degrees")

    def __post_init__(self) -> None:
        if self.traffic not in get_args(Traffic):
            raise InvalidInputError(f"traffic: expected one of {', '.join(get_args(Traffic))}, got {self.traffic!r}")
        if self.aircraft is not None:
            self._whole("aircraft", most=4095)
            if self.traffic != "random":
                raise InvalidInputError(f"aircraft: is of random traffic; {self.traffic} is a pair")
        self._number("duration", "rotation", "reach", above=0.0)
        self._number("false_plots", "identity_loss", "garbled", "range_step", "bearing_step", "time_step", least=0.0)
        self._probability("detection_probability")
        for name in ("identity_loss", "garbled"):
            if not getattr(self, name) < 1:
                raise InvalidInputError(f"{name}: expected a share from 0 to below 1, got {getattr(self, name)!r}")
        if self.separation is not None:
            self._number("separation", least=0.0)
            if self.traffic == "random":
                raise InvalidInputError(
                    "separation: is of a pair (traffic crossing, parallel or head-on), not of random"
                )
        if (self.latitude is None) != (self.longitude is None):
            raise InvalidInputError("latitude, longitude: expected both or neither")
        for name, most in (("latitude", 90.0), ("longitude", 360.0)):
            if getattr(self, name) is not None:
                self._number(name, least=-most, most=most)
        if self.duration > 1e7 * self.rotation:
            raise InvalidInputError(f"duration: expected at most 1e7 rotations, got {self.duration:g} s")

    @property
    def count(self) -> int:
        """How many aircraft there are."""
        if self.traffic != "random":
            return 2
        return 14 if self.aircraft is None else self.aircraft


@dataclass(frozen=True, eq=False)
class SimulatedPlots:
    """A recording, with sources, and its truth."""

    recording: Recording
    truth: Trajectories
    """Where each aircraft in reach was whenever the antenna pointed at it, detected or not."""
    velocities: Array
    """Of the rows of the truth, (n, 3), m/s."""


def simulate(p: RotatingRadarParameters, rng: np.random.Generator, name: str) -> SimulatedPlots:
    """Simulate the plots; see `assoc.simulation.simulate_recording`."""
    # with the metrics comes scipy, too slow for --help
    from assoc.metrics.trajectories import Trajectories

    turns = p.duration / p.rotation
    memory.require(
        _STEP * p.duration / STEP + _PLOT * turns * (p.count + p.false_plots),
        f"plots with duration = {p.duration:g}, rotation = {p.rotation:g}, aircraft = {p.count}, "
        f"false_plots = {p.false_plots:g}",
        "shorten the recording, or lower the number of plots",
    )
    far = p.reach * NAUTICAL_MILE
    if p.traffic == "random":
        flights = [random_flight(rng, 0.08 * far, 0.85 * far, p.duration) for _ in range(p.count)]
    else:
        flights = _pair(p, rng)
    codes = rng.choice(np.arange(1, 4096), len(flights), replace=False)
    seen = [_seen(p, flight) for flight in flights]
    source = np.repeat(np.arange(len(flights)), [len(times) for times, *_ in seen])
    time, position, velocity, height = (np.concatenate(parts) for parts in zip(*seen, strict=True))
    order = np.lexsort((source, time))
    source, time, position, velocity = source[order], time[order], position[order], velocity[order]
    hit = rng.random(len(time)) < p.detection_probability
    distance, bearing = slant_range_and_bearing(position[hit])
    level = np.round(height[order][hit] / FLIGHT_LEVEL)
    identity = np.where(rng.random(hit.sum()) < p.identity_loss, UNDECODED, codes[source[hit]])
    wrong = rng.random(hit.sum()) < p.garbled
    level[wrong] = rng.choice(GARBLED_CODES, int(wrong.sum()))

    count = int(rng.poisson(p.false_plots * turns))
    false_turn = rng.uniform(0.0, turns, count)
    columns = [
        np.concatenate([time[hit], false_turn * p.rotation]),
        np.concatenate([distance, rng.uniform(0.0, p.reach * NAUTICAL_MILE, count)]),
        np.concatenate([bearing, 2 * math.pi * (false_turn % 1.0)]),
        np.concatenate([identity, np.full(count, UNDECODED)]),
        np.concatenate([level, rng.choice(GARBLED_CODES, count)]),
        np.concatenate([source[hit], np.full(count, -1)]),
    ]
    order = np.argsort(columns[0], kind="stable")
    times, ranges, bearings, identities, levels, sources = (column[order] for column in columns)
    recording = Recording(
        times=np.floor(times / p.time_step) * p.time_step if p.time_step else times,
        ranges=in_steps(ranges, p.range_step * NAUTICAL_MILE),
        azimuths=math.pi / 2 - bearings_in_steps(bearings, math.radians(p.bearing_step)),
        identities=identities,
        altitudes=levels * FLIGHT_LEVEL,
        garbled=garbled_altitudes(levels, identities),
        lines=np.arange(2, len(times) + 2),
        sources=sources,
        name=name,
    )
    return SimulatedPlots(recording, Trajectories(time, source, position), velocity)


def _seen(p: RotatingRadarParameters, flight: Flight) -> tuple[Array, Array, Array, Array]:
    """Times at which the antenna points at an aircraft within reach; its positions, velocities and altitudes then."""
    times, positions, velocities = flight.path(p.duration)
    heights = positions[:, 2:]
    if p.latitude is not None and p.longitude is not None:
        latitude, longitude, _ = geodetic(positions * [1, 1, 0], TRAFFIC).T
        site = math.radians(p.latitude), math.radians(p.longitude), 0.0
        positions = east_north_up(latitude, longitude, heights[:, 0], site)
        velocities = np.gradient(positions, STEP, axis=0)
    when = dwells(times, positions, p.rotation)
    when = when[when <= p.duration]
    position, velocity, height = (
        np.column_stack([np.interp(when, times, axis) for axis in x.T]) for x in (positions, velocities, heights)
    )
    step = p.range_step * NAUTICAL_MILE
    inside = in_steps(np.linalg.norm(position, axis=1), step) <= p.reach * NAUTICAL_MILE
    return when[inside], position[inside], velocity[inside], height[inside, 0]


def _pair(p: RotatingRadarParameters, rng: np.random.Generator) -> list[Flight]:
    """Two aircraft that are closest to each other half-way through the recording."""
    middle = NAUTICAL_MILE * rng.uniform(0.25, 0.55) * p.reach
    azimuth = rng.uniform(-math.pi, math.pi)
    meeting = middle * np.array([math.cos(azimuth), math.sin(azimuth)])
    # more across the line of sight than along it, so that no aircraft flies over the radar
    heading = azimuth + math.pi / 2 * rng.choice([-1.0, 1.0]) + math.radians(rng.uniform(-60.0, 60.0))
    speeds = rng.uniform(200.0, 260.0, 2)
    apart = PARALLEL_SEPARATION if p.traffic == "parallel" else 0.0
    apart = NAUTICAL_MILE * (apart if p.separation is None else p.separation)
    other = heading
    along = 0.0
    if p.traffic == "crossing":
        other += math.radians(rng.uniform(40.0, 90.0)) * rng.choice([-1.0, 1.0])
    elif p.traffic == "head-on":
        other += math.pi
    else:
        # side by side, nearly: neither overtakes the other
        speeds[1] = speeds[0]
        along = NAUTICAL_MILE * rng.uniform(-2.0, 2.0)
    level = 304.8 * rng.integers(30, 39)
    flights = []
    for number, (direction, speed) in enumerate(zip((heading, other), speeds, strict=True)):
        forward = np.array([math.cos(direction), math.sin(direction)])
        # the second one is off to the side of the first
        side = np.array([-math.sin(heading), math.cos(heading)])
        there = meeting + number * (apart * side + along * forward)
        flights.append(
            Flight(there - speed * p.duration / 2 * forward, float(direction), float(speed), level + 304.8 * number)
        )
    return flights
