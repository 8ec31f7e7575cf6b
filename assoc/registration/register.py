"""Registration of a whole scene at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.registration.epochs import scene_epochs
from assoc.registration.estimation import Estimate, Problem, estimate
from assoc.registration.pairing import Epoch
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.result import Registration, Residuals, noise_factor
from assoc.registration.terms import make_terms
from assoc.scene.scene import Scene


@explains_wrong_types
@interruptible()
def register(scene: Scene, parameters: RegistrationParameters | None = None, **values: Any) -> Registration:
    """Estimate the biases of the sensors of a scene from the targets that they have in common.

    No truth is needed. Scans are associated with gates as wide as the biases may be, biases are estimated from the
    tuples found, and both again with narrower gates, until the gates are those of the noise. Tuples that do not fit
    have little weight. Biases that are not observable are named, and stay near zero.

    Parameters
    ----------
    scene : Scene
    parameters : RegistrationParameters, optional
    **values
        Fields of `RegistrationParameters`, in place of those of `parameters`.

    Returns
    -------
    Registration

    Raises
    ------
    InvalidInputError
        A parameter is not as described, or a sensor is of a user's class.

    References
    ----------
    Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9.
    """
    if not isinstance(scene, Scene):
        raise InvalidInputError(f"scene: expected a Scene, got {type(scene).__name__}")
    try:
        chosen = replace(parameters or RegistrationParameters(), **values)
    except TypeError as error:
        raise InvalidInputError(f"registration: {str(error).split('__init__() ')[-1]}") from None
    problem = make_problem(scene, chosen)
    epochs = scene_epochs(scene, moving=any(term.component == "time" for term in problem.terms))
    return result_of(problem, epochs, estimate(problem, epochs))


def make_problem(scene: Scene, parameters: RegistrationParameters) -> Problem:
    """The biases of a scene's sensors, and their prior."""
    carried = any(sensor.platform is not None for sensor in scene.sensors)
    if carried and not (scene.measurement_times is None and scene.sectors is None):
        raise InvalidInputError(
            "registration: of sensors on platforms scans of one instant are expected, without times and sectors"
        )
    terms = make_terms(scene.sensors, parameters)
    spreads = np.array([parameters.spread(term.component) for term in terms])
    return Problem(tuple(scene.sensors), terms, spreads, scene.region, parameters)


def result_of(problem: Problem, epochs: list[Epoch], found: Estimate) -> Registration:
    """The result, with the residuals of the same tuples before and after."""
    left: list[Array] = []
    noise = 0.0
    for biases in (np.zeros(len(problem.terms)), found.biases):
        sums = problem.equations(epochs, found.chosen, biases)
        left.append(sums.left)
        noise = noise_factor(sums.chi, sums.freedom)
    times = np.array([epochs[k].time for k in found.chosen.epoch.tolist()])
    residuals = []
    for s, sensor in enumerate(problem.sensors):
        d = sensor.position_part.dim
        mine = ~np.isnan(left[0][:, s, :d]).any(axis=1) & ~np.isnan(left[1][:, s, :d]).any(axis=1)
        residuals.append(Residuals(times[mine], left[0][mine, s, :d], left[1][mine, s, :d]))
    return Registration(
        problem.sensors, problem.terms, found.biases, found.covariance, problem.spreads, found.information,
        len(found.chosen), found.chosen.skipped, noise, tuple(residuals),
    )  # fmt: skip
