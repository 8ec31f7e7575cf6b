"""Longitudinal flight of an unmanned aircraft: angle of climb, speed, distance and height."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.motion.models import ForwardDifference
from assoc.filters.state import finite


@dataclass(frozen=True)
class Aerodynamics:
    """Constants of the aircraft; the paper gives none, these are published for the same model.

    Parameters
    ----------
    mass, gravity, area
        m (kg), g (m/s^2), S_ref (m^2).
    drag : (A1, A2, A3)
        C_d = A1 a^2 + A2 a + A3, a the angle of attack in rad.
    lift : (B1, B2)
        C_l = B1 a + B2.
    density : (C1, C2, C3)
        rho = C1 h^2 + C2 h + C3, kg/m^3.
    """

    mass: float = 1005.0
    gravity: float = 9.81
    area: float = 0.3376
    drag: tuple[float, float, float] = (-1.9431, -0.1499, 0.2359)
    lift: tuple[float, float] = (21.9, 0.0)
    density: tuple[float, float, float] = (3.312e-9, -1.142e-4, 1.224)

    def __post_init__(self) -> None:
        for field in fields(self)[:3]:
            positive(getattr(self, field.name), field.name)
        for name, count in (("drag", 3), ("lift", 2), ("density", 3)):
            if finite(getattr(self, name), name, 1).shape != (count,):
                raise InvalidInputError(f"{name} must have {count} coefficients")


class UnmannedAircraft(ForwardDifference):
    """The paper's aircraft as a motion model, [climb angle (rad), speed (m/s), x (m), h (m)].

    Parameters
    ----------
    thrust : float
        T, newton.
    attack : float
        Angle of attack, rad.
    covariance : array_like (4, 4)
        Process noise of one step.
    aerodynamics : Aerodynamics

    References
    ----------
    The paper on Dubins paths and the ensemble Kalman filter, equations 1, 2 and 19, with thrust less drag and lift both
    in body axes. In print drag acts along the path and lift across the body (T sin a in the climb, T cos a - D in the
    speed), and in 19 and 21 the row of the speed adds gamma_k where v_k is meant.
    """

    def __init__(
        self, thrust: float, attack: float, covariance: Array, aerodynamics: Aerodynamics | None = None
    ) -> None:
        super().__init__(covariance, 4, (2, 3))
        self.thrust = positive(thrust, "thrust", zero=True)
        if not math.isfinite(attack):
            raise InvalidInputError(f"attack must be a finite number, got {attack!r}")
        self.attack = float(attack)
        self.aerodynamics = aerodynamics if aerodynamics is not None else Aerodynamics()

    def rates(self, states: Array) -> Array:
        """Time derivatives of states (m, 4), equations 1 and 2 in body axes."""
        k, a = self.aerodynamics, self.attack
        climb, v, _, h = states.T
        pressure = 0.5 * np.polyval(k.density, h) * v**2 * k.area
        D, L = pressure * np.polyval(k.drag, a), pressure * np.polyval(k.lift, a)
        along, across = self.thrust - D, L
        return np.stack(
            [
                (along * np.sin(a) + across * np.cos(a)) / (k.mass * v) - k.gravity * np.cos(climb) / v,
                (along * np.cos(a) - across * np.sin(a)) / k.mass - k.gravity * np.sin(climb),
                v * np.cos(climb),
                v * np.sin(climb),
            ],
            axis=1,
        )

    def slopes(self, states: Array) -> Array:
        """Derivatives of `rates` at states (m, 4): (m, 4, 4)."""
        k, a = self.aerodynamics, self.attack
        climb, v, _, h = states.T
        rho, slope = np.polyval(k.density, h), np.polyval(np.polyder(np.array(k.density)), h)
        unit = 0.5 * v**2 * k.area
        cd, cl = np.polyval(k.drag, a), np.polyval(k.lift, a)
        up, ahead = cl * np.cos(a) - cd * np.sin(a), -cd * np.cos(a) - cl * np.sin(a)
        J = np.zeros((len(states), 4, 4))
        J[:, 0, 0] = k.gravity * np.sin(climb) / v
        # thrust and weight fall with 1/v, lift grows with v
        J[:, 0, 1] = (
            -self.thrust * np.sin(a) / (k.mass * v**2)
            + 0.5 * rho * k.area * up / k.mass
            + k.gravity * np.cos(climb) / v**2
        )
        J[:, 0, 3] = slope * unit * up / (k.mass * v)
        J[:, 1, 0] = -k.gravity * np.cos(climb)
        J[:, 1, 1] = rho * v * k.area * ahead / k.mass
        J[:, 1, 3] = slope * unit * ahead / k.mass
        J[:, 2, 0], J[:, 2, 1] = -v * np.sin(climb), np.cos(climb)
        J[:, 3, 0], J[:, 3, 1] = v * np.cos(climb), np.sin(climb)
        return J
