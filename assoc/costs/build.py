"""From a scan of a scene to the assignment problem; costs and positions of given tuples."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence

import numpy as np

from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.costs import positions
from assoc.costs.arrays import SensorArrays, sensor_arrays, unmissed
from assoc.costs.arrivals.fit import any_arrivals
from assoc.costs.arrivals.tuples import grow_arrivals
from assoc.costs.gating import Gates, make_gates
from assoc.costs.growth import grow
from assoc.costs.limits import fitting
from assoc.costs.own_sensors import any_own, every_pair
from assoc.costs.own_times import timed_costs, timed_positions, timed_problem
from assoc.costs.pairs import coarse_pairs, compatible_pairs
from assoc.costs.positions import measured_and_fit, scan_of
from assoc.costs.prices import PositionPrior, position_prior, with_prior
from assoc.costs.range_rates import SPEED, range_rates
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene

GATE_PROBABILITY = 0.999
"""Default share of true tuples that each chi-square gate lets through."""


@explains_wrong_types
@interruptible()
def build_problem(
    scene: Scene,
    scan: int | Scan,
    *,
    gate_probability: float = GATE_PROBABILITY,
    max_tuples: int | None = None,
    speed: float | Sequence[float] = SPEED,
    target_density: float | str | None = None,
    all_tuples: bool = False,
    blind: Array | None = None,
) -> AssignmentProblem:
    """Make the assignment problem of a scan: candidate tuples of measurements and their costs.

    A tuple of two or more measurements is a candidate if

    * each pair of its measurements passes the chi-square gate of that pair,
    * all of them together pass the gate of their degrees of freedom,
    * its cost is negative: otherwise its measurements are better declared false alarms, at cost 0 each.

    Measurements with their own times are compared through the target's predicted motion: straight flight, velocities of
    the prior `speed`; gates are those of a measurement given the previous ones.

    Of arrival times (`assoc.sensors.ArrivalTimeSensor`) a candidate has four or, in a plane, three, and one degree of
    freedom less; with more than eight receivers only parts of an emission whose rest may be another's are listed.

    Degrees of freedom are the components measured less the coordinates estimated (three with a sensor that
    measures full positions, else two), at least one. Where no sensor of a tuple measures full positions,
    heights are sought within three half heights of the middle of the scene's region.

    Parameters
    ----------
    scene : Scene
    scan : int or Scan
        Number of the scan, or a scan of that scene.
    gate_probability : float
        Probability with which measurements of one target pass a gate, in (0, 1]; 1 leaves only the sign
        of the cost.
    max_tuples : int, optional
        The most candidate tuples that may be made; None: as many as the available memory has room for.
    speed : float or sequence of float
        Prior standard deviation of a target's velocity along each axis, m/s, for range rates and for measurements of
        different times; without these it has no effect.
    target_density : float or "auto", optional
        None is equation 5: the likelihood at the best position. A number is the density of targets in the region,
        per m^3 (per m^2 if no sensor measures full positions): positions are integrated out under it, and a cost gains
        -ln(density (2 pi)^(n/2) det(P)^(1/2)) with P the covariance of the position. "auto" takes the density from the
        numbers of measurements in the scene. The prior is right where measurements hardly determine positions, as
        bearings: equation 5 then finds too many targets.
    all_tuples : bool
        Whether to list every tuple, (n_1 + 1) ... (n_S + 1) - 1 of them, gated or not and whatever it costs: the
        papers' full grid. Its optimum is that of the candidates; `AssignmentProblem.to_dense` makes it a tensor.
    blind : bool array (S,), optional
        Sensors that may not see a target, so that they need not have missed it: candidates are then the tuples whose
        cost without the misses of these sensors is negative. Costs are those of equation 5, misses included.

    Returns
    -------
    AssignmentProblem

    Raises
    ------
    LimitExceededError
        There are more tuples than `max_tuples`; the message has their number, or an estimate.
    InvalidInputError
        An argument is out of range.

    References
    ----------
    The ant colony paper, equations 1-5; with clutter density r / V in place of 1 / V.
    """
    probability = _checked_probability(gate_probability)
    scene, chosen = _by_pose(scene, scan)
    most = _most_tuples(max_tuples, chosen)
    if all_tuples:
        return _whole_grid(scene, chosen, most, speed, target_density)
    if not chosen.at_once:
        _refuse_prior(target_density)
        return timed_problem(scene, chosen, probability, most, speed)
    prior = position_prior(scene, sensor_arrays(scene), target_density)
    return _gated_problem(scene, chosen, probability, most, speed, prior, blind)


def _gated_problem(
    scene: Scene,
    scan: Scan,
    probability: float,
    most: int,
    speed: float | Sequence[float],
    prior: PositionPrior | None,
    blind: Array | None,
) -> AssignmentProblem:
    """The candidates of a scan of one instant: pairs that pass their gates, grown to tuples."""
    bare = sensor_arrays(scene)
    sensors = with_prior(bare, prior)
    if blind is not None and blind.any():
        misses = np.log1p([-sensor.detection_probability for sensor in scene.sensors])
        sensors = unmissed(sensors, misses, blind)
    if any_arrivals(scene):
        tuples, costs = grow_arrivals(scene, sensors, scan, probability, prior, most)
        if blind is not None and blind.any():
            costs = costs - np.where(blind & (tuples == 0), misses, 0.0).sum(axis=1)
        return AssignmentProblem(tuples, costs, scan.sizes)
    gates = _gates(scene, sensors, probability)
    limited = gates.pair[~np.eye(len(scene.sensors), dtype=np.bool_)]
    reach, least = (float(limited.max()), float(limited.min())) if limited.size else (1.0, 1.0)
    measured, index, fit = measured_and_fit(scene, sensors, scan, reach, least)
    limits = {"number": scan.index, "max_tuples": most}
    coarse = every_pair(measured) if any_own(scene) else coarse_pairs(sensors, measured, gates.pair)
    pairs = compatible_pairs(measured, fit, coarse, gates, **limits)
    rates = range_rates(scene, scan, speed)
    rows, costs = grow(sensors, measured, fit, pairs, gates, rates=rates, prior=prior, **limits)
    if blind is not None and blind.any():
        costs = costs - np.where(blind & (rows < 0), misses, 0.0).sum(axis=1)
    padded = np.append(index, np.int32(0))  # row -1, a missed detection, becomes index 0
    return AssignmentProblem(padded[rows], costs, scan.sizes)


def _checked_probability(gate_probability: object) -> float:
    try:
        probability = float(gate_probability)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        probability = math.nan
    if not 0.0 < probability <= 1.0:
        raise InvalidInputError(f"gate_probability must be above 0 and at most 1, got {gate_probability!r}")
    return probability


def _most_tuples(max_tuples: int | None, scan: Scan) -> int:
    most = fitting(scan.sizes.tolist()) if max_tuples is None else max_tuples
    if isinstance(most, bool) or not isinstance(most, (int, np.integer)) or most < 1:
        raise InvalidInputError(f"max_tuples must be a whole number above 0, got {max_tuples!r}")
    return int(most)


def _whole_grid(
    scene: Scene, chosen: Scan, most: int, speed: float | Sequence[float], density: float | str | None
) -> AssignmentProblem:
    shape = [int(size) + 1 for size in chosen.sizes]
    count = math.prod(shape) - 1
    if count > most:
        raise LimitExceededError(
            f"scan {chosen.index}: {count:.3g} tuples, more than max_tuples = {most}; leave out all_tuples, or raise it"
        )
    # the first of the grid is the tuple without measurements, which no problem has
    tuples = np.ascontiguousarray(np.indices(shape, dtype=np.int32).reshape(len(shape), -1).T[1:])
    costs = tuple_costs(scene, chosen, tuples, speed=speed, target_density=density)
    # too few arrival times are no position
    known = costs < math.inf
    return AssignmentProblem(tuples[known], costs[known], chosen.sizes)


@explains_wrong_types
def tuple_costs(
    scene: Scene,
    scan: int | Scan,
    tuples: Array,
    *,
    speed: float | Sequence[float] = SPEED,
    target_density: float | str | None = None,
) -> Array:
    """Cost of given tuples, gated or not, by equation 5 or with a prior; a single measurement costs 0, a false alarm.

    Parameters
    ----------
    scene, scan
        See `build_problem`.
    tuples : array_like of int (K, S)
        1-based measurement of each sensor, 0 where it missed the target.
    speed, target_density
        See `build_problem`.

    Returns
    -------
    ndarray (K,)

    Raises
    ------
    InvalidInputError
        The tuples have the wrong shape, an index out of range, or no measurement.
    """
    scene, chosen = _by_pose(scene, scan)
    if chosen.at_once:
        return positions.tuple_costs(scene, chosen, tuples, speed=speed, target_density=target_density)
    _refuse_prior(target_density)
    return timed_costs(scene, chosen, tuples, speed)


@explains_wrong_types
def positions_and_covariances(
    scene: Scene, scan: int | Scan, tuples: Array, *, speed: float | Sequence[float] = SPEED
) -> tuple[Array, Array]:
    """Positions of tuples at the scan's time, and their covariances.

    Where all measurements are of that time, they are the maximum-likelihood positions (equation 4), and the speed has
    no effect. Directions that the measurements leave open are those of the scene's region: mean in its middle, standard
    deviation half its width. So a position always exists.

    Parameters
    ----------
    scene, scan, tuples, speed
        See `tuple_costs`.

    Returns
    -------
    positions (K, 3), covariances (K, 3, 3)
        Metres; the covariance is the inverse information at the position.

    Raises
    ------
    InvalidInputError
        As `tuple_costs`.
    """
    scene, chosen = _by_pose(scene, scan)
    if chosen.at_once:
        return positions.positions_and_covariances(scene, chosen, tuples)
    return timed_positions(scene, chosen, tuples, speed)


@explains_wrong_types
def emission_times(scene: Scene, scan: int | Scan, tuples: Array) -> Array:
    """When targets emitted what receivers heard (`assoc.sensors.ArrivalTimeSensor`), at their most likely positions.

    Parameters
    ----------
    scene, scan, tuples
        See `tuple_costs`.

    Returns
    -------
    ndarray (K,)
        Seconds, since what arrival times count from.

    Raises
    ------
    InvalidInputError
        As `tuple_costs`, or the scene has no arrival times.
    """
    if not any_arrivals(scene):
        raise InvalidInputError("scene: its sensors measure no arrival times")
    scene, chosen = _by_pose(scene, scan)
    return np.asarray(positions.fitted_arrivals(scene, chosen, tuples)[1][1])


def _by_pose(scene: Scene, scan: int | Scan) -> tuple[Scene, Scan]:
    """Sensors as they stand at the scan's time, and the scan as they measure it."""
    chosen = scan_of(scene, scan)
    any_arrivals(scene)  # refuses what these cannot be mixed with
    return scene.at(chosen.time), chosen.aligned(scene.sensors)


def _refuse_prior(target_density: float | str | None) -> None:
    if target_density is not None:
        raise InvalidInputError("target_density: not supported for measurements with their own times; leave it out")


_known_gates: weakref.WeakKeyDictionary[Scene, dict[tuple[float, float], Gates]] = weakref.WeakKeyDictionary()


def _gates(scene: Scene, sensors: SensorArrays, probability: float) -> Gates:
    known = _known_gates.setdefault(scene, {})
    key = (probability, sensors.base)
    if key not in known:
        known[key] = make_gates(sensors, probability)
    return known[key]
