"""Tracks and the measurements of a scan as an assignment problem whose weights are probabilities."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from assoc._system.wrong_types import explains_wrong_types
from assoc.costs.build import GATE_PROBABILITY
from assoc.costs.limits import MAX_TUPLES
from assoc.costs.tracks.scores import existence_gain, score_terms
from assoc.costs.tracks.tuples import grow_track_tuples
from assoc.costs.views import Views, log_missed
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.imm import InteractingMultipleModel, Mixture
from assoc.problem import AssignmentProblem
from assoc.sensors import Sensor
from assoc.sensors.arrays import numbers
from assoc.tracking.stages.checking import checked_measurements


@explains_wrong_types
def track_problem(
    filter: Filter[Any],
    states: Any,
    sensors: Sequence[Sensor],
    measurements: Sequence[ArrayLike],
    existence: ArrayLike = 1.0,
    *,
    gate_probability: float = GATE_PROBABILITY,
    max_tuples: int = MAX_TUPLES,
) -> AssignmentProblem:
    """Return the problem of T tracks, as its first list, and a scan of S sensors, for given probabilities of existence.

    A solution weighs exp(-cost) in proportion to its posterior probability: with `assoc.marginals` that is the
    probability of every tuple (track, measurement or none of each sensor), with `assoc.kbest` that of each of the best
    associations relative to the others. Measurements in no tuple are false alarms, at cost 0.

    Parameters
    ----------
    filter : Filter
    states
        States of the filter, predicted to the scan; T of them.
    sensors : sequence of Sensor
        At least one, each standing; of one on a platform give it as it stands at the scan.
    measurements : sequence of array_like (n_s, d_s)
        Of each sensor, of one instant.
    existence : array_like (T,) or float
        Probability that each track is a target, above 0 and at most 1.
    gate_probability : float
        Share of true measurements inside the gate, above 0, at most 1; tuples outside have no probability.
    max_tuples : int

    Raises
    ------
    InvalidInputError
        An argument is not as described.
    LimitExceededError
        There are more than `max_tuples` candidate tuples.

    Notes
    -----
    With the probability of existence r, the detections and misses of the tuple for a target in exp(-L), all relative to
    false alarms, and L_0 that of a target all sensors missed, a tuple with measurements costs L - ln r: only a target
    is detected. The track alone costs -ln(1 - r + r exp(-L_0)): it is false, or its target was missed. So with p the
    probability of the track alone, it exists after the scan with probability 1 - p + p r exp(-L_0) / (1 - r + r
    exp(-L_0)).

    References
    ----------
    D. Musicki, R. Evans, Joint integrated probabilistic data association: JIPDA, IEEE Trans. Aerospace and Electronic
    Systems 40, 2004.
    """
    _check_states(filter, states)
    chance = numbers(existence, "existence")
    if chance.shape not in ((), (1,), (len(states),)):
        raise InvalidInputError(f"existence: expected one number, or one for each of {len(states)} tracks, "
                                f"got shape {chance.shape}")  # fmt: skip
    if not ((chance > 0.0) & (chance <= 1.0)).all():
        raise InvalidInputError("existence: expected probabilities above 0 and at most 1")
    _check_sensors(sensors)
    scan = checked_measurements(list(measurements), sensors)
    terms = score_terms(sensors)
    missed = log_missed(terms.miss, Views(sensors, filter.motion.position).shares(states))
    tuples = grow_track_tuples(
        filter, states, scan, sensors, terms, missed,
        gate_probability=gate_probability, max_tuples=max_tuples, margin=math.inf,
    )  # fmt: skip
    with np.errstate(divide="ignore"):
        odds = np.broadcast_to(np.log(chance) - np.log1p(-chance), (len(states),))
    gain = existence_gain(odds[tuples.track], -tuples.costs, np.asarray(tuples.rows.any(axis=1)))
    sizes = [len(states), *(len(z) for z in scan)]
    return AssignmentProblem(np.column_stack([tuples.track + 1, tuples.rows]), -gain, sizes)


def _check_states(filter: Filter[Any], states: Any) -> None:
    mean = getattr(states, "mean", None)
    if (
        not isinstance(mean, np.ndarray)
        or mean.shape[1:] != (filter.motion.dim,)
        or (isinstance(filter, InteractingMultipleModel) is not isinstance(states, Mixture))
    ):
        raise InvalidInputError(f"states: expected states of {filter.motion.dim} components as the filter makes them")


def _check_sensors(sensors: Sequence[Sensor]) -> None:
    if not len(sensors):
        raise InvalidInputError("sensors: expected at least one")
    for s, sensor in enumerate(sensors):
        if sensor.platform is not None:
            raise InvalidInputError(f"sensors: number {s + 1} is on a platform, expected one that stands at a position")
