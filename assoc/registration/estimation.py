"""Biases from looks of several sensors: associate, estimate, and again, with gates that close in on the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.registration.correction import own_biases
from assoc.registration.normal_equations import NormalEquations, normal_equations
from assoc.registration.pairing import (
    Chosen,
    Looks,
    choose_tuples,
    corrected_scene,
    places_of,
    tuple_arrays,
    widened,
)
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.terms import Term, term_arrays
from assoc.scene.scene import Scene
from assoc.sensors import Sensor

SHARES = (1.0, 0.5, 0.25, 0.12, 0.05, 0.0, 0.0, 0.0)
"""How much of the spread the gates still allow for in each round of association and estimation."""

_STEPS = 4
# the widest tuples that count fully
_LIMIT = 0.95
# rounds with wide gates need no more plots than this
_EARLY_PLOTS = 4_000


@dataclass(frozen=True)
class Estimate:
    """Biases after some rounds.

    Attributes
    ----------
    biases : array (n,)
    covariance : array (n, n)
    information : array (n, n)
        What the measurements alone tell.
    chosen : Chosen
        The tuples of the last round.
    """

    biases: Array
    covariance: Array
    information: Array
    chosen: Chosen


@dataclass(frozen=True)
class Problem:
    """What is estimated from what: sensors, biases with their prior, measurements."""

    sensors: tuple[Sensor, ...]
    terms: tuple[Term, ...]
    spreads: Array
    region: Array
    parameters: RegistrationParameters

    def scene(self, looks: Sequence[Looks], biases: Array) -> Scene:
        """The looks without these biases."""
        return corrected_scene(self.sensors, looks, self.terms, biases, self.region)

    def equations(
        self, looks: Sequence[Looks], chosen: Chosen, biases: Array, noise: Scene | None = None
    ) -> NormalEquations:
        """Normal equations of chosen tuples around biases, with the sensors' own noise or that of another scene."""
        limits = chi_square_quantiles(_LIMIT, 3 * len(self.sensors))
        scene = self.scene(looks, biases)
        clocks = np.array([own_biases(self.terms, biases, s).get("time", 0.0) for s in range(len(self.sensors))])
        tuples = tuple_arrays(scene, looks, chosen, clocks)
        places = places_of(scene.sensors)
        if noise is not None:
            places = places._replace(weight=places_of(noise.sensors).weight)
        return normal_equations(places, tuples, term_arrays(self.terms, self.sensors), limits)


def estimate(problem: Problem, looks: Sequence[Looks], start: Estimate | None = None) -> Estimate:
    """Find the biases.

    Parameters
    ----------
    problem : Problem
    looks : sequence of Looks
    start : Estimate, optional
        What is known; without it biases are taken for zero, give or take their spreads.

    Returns
    -------
    Estimate
    """
    n = len(problem.terms)
    biases = np.zeros(n) if start is None else start.biases
    covariance = np.diag(problem.spreads**2) if start is None else start.covariance
    sample = _sample(looks)
    first, found = np.sqrt(np.diagonal(covariance)), None
    for share in SHARES:
        used = sample if share > 0.0 else looks
        left = share * first if share > 0.0 else np.sqrt(np.diagonal(covariance))
        wide = widened(problem.scene(used, biases), problem.terms, left)
        chosen = choose_tuples(wide, problem.parameters)
        noise = wide if share > 0.0 else None
        biases, covariance, information = _solve(problem, used, chosen, biases, noise)
        found = Estimate(biases, covariance, information, chosen)
    assert found is not None
    return found


def _sample(looks: Sequence[Looks]) -> Sequence[Looks]:
    """Every so many looks, as long as they have plots enough."""
    plots = sum(len(z) for one in looks for z in one.measurements)
    return looks[:: max(1, plots // _EARLY_PLOTS)]


def _solve(
    problem: Problem, looks: Sequence[Looks], chosen: Chosen, biases: Array, noise: Scene | None
) -> tuple[Array, Array, Array]:
    """Gauss-Newton on fixed tuples: biases, their covariance, and the information of the measurements."""
    prior = np.diag(problem.spreads**-2.0)
    for step in range(_STEPS):
        sums = problem.equations(looks, chosen, biases, noise)
        inverse = np.linalg.inv(sums.information + prior)
        change = inverse @ (sums.gradient - prior @ biases)
        biases = biases + change
        if step and (np.abs(change) < 1e-3 * np.sqrt(np.diagonal(inverse))).all():
            break
    # the sandwich: right also where the noise is not what the sensors say
    covariance = inverse @ (sums.scatter + prior) @ inverse
    return biases, 0.5 * (covariance + covariance.T), sums.information
