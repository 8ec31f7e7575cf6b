"""Biases from epochs of several sensors: associate, estimate, and again, with gates that close in on the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from assoc._types import Array
from assoc.costs.arrays import sensor_arrays
from assoc.costs.gating import chi_square_quantiles
from assoc.registration.correction import biases_of_sensors
from assoc.registration.normal_equations import NormalEquations, normal_equations
from assoc.registration.pairing import (
    Chosen,
    Epoch,
    choose_tuples,
    corrected_scene,
    tuple_arrays,
    widened,
)
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.terms import Term, owners, term_arrays
from assoc.scene.scene import Scene
from assoc.sensors import Sensor

SHARES = (1.0, 0.5, 0.25, 0.12, 0.05, 0.0, 0.0, 0.0)
"""Share of the spread by which gates are widened in each round of association and estimation."""

_STEPS = 4
# the widest tuples that count fully
_LIMIT = 0.95
# rounds with wide gates use about so many plots
_EARLY_PLOTS = 4_000


@dataclass(frozen=True)
class Estimate:
    """Biases (n,) after some rounds, and their covariance (n, n)."""

    biases: Array
    covariance: Array
    information: Array
    """That of the measurements alone, (n, n)."""
    chosen: Chosen
    """The tuples of the last round."""


@dataclass(frozen=True)
class Problem:
    """Sensors, the biases to estimate, and their prior."""

    sensors: tuple[Sensor, ...]
    terms: tuple[Term, ...]
    spreads: Array
    region: Array
    parameters: RegistrationParameters

    def scene(self, epochs: Sequence[Epoch], biases: Array) -> Scene:
        """The epochs without these biases."""
        return corrected_scene(self.sensors, epochs, self.terms, biases, self.region)

    def equations(
        self, epochs: Sequence[Epoch], chosen: Chosen, biases: Array, noise: Scene | None = None
    ) -> NormalEquations:
        """Normal equations of chosen tuples around biases, with the sensors' own noise or that of another scene."""
        limits = chi_square_quantiles(_LIMIT, 3 * len(self.sensors))
        scene = self.scene(epochs, biases)
        by_sensor = biases_of_sensors(self.sensors, self.terms, biases)
        clocks = np.array([known.get("time", 0.0) for known in by_sensor])
        tuples = tuple_arrays(scene, epochs, chosen, clocks)
        sensors = sensor_arrays(scene)
        if noise is not None:
            sensors = sensors._replace(weight=sensor_arrays(noise).weight)
        # each sensor has terms of its own in the sums, which are then those of whose they are
        each = [
            (j, term._replace(sensor=s))
            for s, owner in enumerate(owners(self.sensors))
            for j, term in enumerate(self.terms)
            if term.sensor == owner
        ]
        terms = term_arrays([term for _, term in each], self.sensors)
        sums = NormalEquations(*normal_equations(sensors, tuples, terms, limits))
        fold = np.eye(len(self.terms))[[j for j, _ in each]]
        return sums._replace(
            information=fold.T @ sums.information @ fold,
            gradient=fold.T @ sums.gradient,
            scatter=fold.T @ sums.scatter @ fold,
            slope=fold.T @ sums.slope @ fold,
        )


def estimate(problem: Problem, epochs: Sequence[Epoch]) -> Estimate:
    """Find the biases, from zero and with their spreads as standard deviations."""
    biases, covariance = np.zeros(len(problem.terms)), np.diag(problem.spreads**2)
    sample = _sample(epochs)
    first, found = np.sqrt(np.diagonal(covariance)), None
    for share in SHARES:
        used = sample if share > 0.0 else epochs
        left = share * first if share > 0.0 else np.sqrt(np.diagonal(covariance))
        wide = widened(problem.scene(used, biases), problem.terms, left)
        chosen = choose_tuples(wide, problem.parameters)
        noise = wide if share > 0.0 else None
        biases, covariance, information = _solve(problem, used, chosen, biases, noise)
        found = Estimate(biases, covariance, information, chosen)
    assert found is not None
    return found


def _sample(epochs: Sequence[Epoch]) -> Sequence[Epoch]:
    """Every k-th epoch, k as large as enough plots remain."""
    plots = sum(len(z) for epoch in epochs for z in epoch.measurements)
    return epochs[:: max(1, plots // _EARLY_PLOTS)]


def _solve(
    problem: Problem, epochs: Sequence[Epoch], chosen: Chosen, biases: Array, noise: Scene | None
) -> tuple[Array, Array, Array]:
    """Gauss-Newton on fixed tuples: biases, their covariance, and the information of the measurements."""
    prior = np.diag(problem.spreads**-2.0)
    for step in range(_STEPS):
        sums = problem.equations(epochs, chosen, biases, noise)
        inverse = np.linalg.inv(sums.information + prior)
        change = inverse @ (sums.gradient - prior @ biases)
        biases = biases + change
        if step and (np.abs(change) < 1e-3 * np.sqrt(np.diagonal(inverse))).all():
            break
    # the sandwich estimator holds even if the sensors' stated noise is wrong; between the slopes at the estimate, which
    # weights that depend on the fit make flatter than the information: deviations by that would be too small
    slope = sums.slope + prior
    if np.linalg.eigvalsh(problem.spreads[:, None] * slope * problem.spreads).min() > 0.0:
        inverse = np.linalg.inv(slope)
    covariance = inverse @ (sums.scatter + prior) @ inverse
    return biases, 0.5 * (covariance + covariance.T), sums.information
