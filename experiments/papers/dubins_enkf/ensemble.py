"""The ensemble Kalman filter on the aircraft: the paper's two simulations (both figures 4), members, what is measured.

dt 0.0167 s, 120 steps, 400 runs. The paper gives no constants of the aircraft, no noise and no angle of attack: chosen
by us. The process noise (sigmas 0.03, 1.7, 0.17, 0.18) is the paper's reported error, rounded: with it the agreement is
built in, and says nothing. So the same is done with a third and with three times of it, and once with drag and lift as
equation 1 prints them, in the target and in the filter.
"""

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import EnsembleKalmanFilter, ExtendedKalmanFilter, Gaussian, LinearMeasurement, UnmannedAircraft
from assoc.filters.base import Filter
from experiments.common.claims import Claim
from experiments.common.command import mean_interval
from experiments.filters.b1 import ratio_interval
from experiments.papers.clustering_time_window.pairs import wilson

STATES = ("climb angle", "speed", "distance", "height")
UNITS = ("rad", "m/s", "m", "m")
FIXED_RMS = (0.031752, 1.7216, 0.17277, 0.18417)
"""N = 300, fixed angle of attack."""
CHANGING_RMS = (0.030345, 1.8291, 0.17655, 0.20351)
"""N = 100, changing angle of attack; the second is printed 18291, without its decimal sign."""
DT, STEPS = 0.0167, 120
START = np.array([0.0, 272.0, 0.0, 150.0])
Q_SIGMA = np.array([0.03, 1.7, 0.17, 0.18])
R_SIGMA = np.array([0.05, 2.8, 0.28, 0.30])
THRUST, ATTACK = 3000.0, 0.03
"""The attack angle is not in the paper; this one carries the weight at 272 m/s."""
CHANGING = ATTACK + 0.02 * np.sin(2 * np.pi * np.arange(STEPS) / STEPS)
"""Chosen by us: one oscillation over the run."""
MEASURED = {"all": (0, 1, 2, 3), "x, h": (2, 3), "x": (2,)}
SIZES = (10, 20, 50, 100, 200, 300, 500)
LIMITS = {"speed": (200.0, 310.0), "thrust": (1000.0, 6000.0)}
"""Of equation 4, which gives no numbers: those of the published aircraft whose constants are used."""
SCALES = {"a third of": 1 / 3, "": 1.0, "three times": 3.0}


class AsPrinted(UnmannedAircraft):
    """The aircraft of equation 1 as it is printed: drag along the path, lift across the body; for ensembles alone."""

    def rates(self, states: Array) -> Array:
        """Time derivatives of states (m, 4)."""
        k, a = self.aerodynamics, self.attack
        climb, v, _, h = states.T
        pressure = 0.5 * np.polyval(k.density, h) * v**2 * k.area
        D, L = pressure * np.polyval(k.drag, a), pressure * np.polyval(k.lift, a)
        found = super().rates(states)
        found[:, 0] = (self.thrust * np.sin(a) + L * np.cos(a)) / (k.mass * v) - k.gravity * np.cos(climb) / v
        found[:, 1] = (self.thrust * np.cos(a) - D - L * np.sin(a)) / k.mass - k.gravity * np.sin(climb)
        return found


class Simulation:
    """Truth and full measurements (STEPS + 1, count, 4) for an angle of attack and a process noise."""

    def __init__(
        self, attack: Array, q: Array, count: int, rng: np.random.Generator, kind: type[UnmannedAircraft] | None = None
    ) -> None:
        self.attack, self.q = attack, q
        self.motion = (kind or UnmannedAircraft)(THRUST, float(attack[0]), np.diag(q**2))
        truth = [np.tile(START, (count, 1))]
        for angle in attack:
            self.motion.attack = float(angle)
            truth.append(self.motion.propagate(truth[-1], DT) + rng.standard_normal((count, 4)) * q)
        self.truth = np.stack(truth)
        self.seen = self.truth + rng.standard_normal(self.truth.shape) * R_SIGMA

    def follow(self, filter: Filter[Any], measured: str = "all") -> Array:
        """Estimates (STEPS + 1, count, 4) of a filter on this simulation's motion."""
        index = list(MEASURED[measured])
        sensor = LinearMeasurement(np.eye(4)[index], np.diag(R_SIGMA[index] ** 2))
        state = filter.start(Gaussian(self.truth[0], np.diag(self.q**2)))
        means = [self.truth[0]]
        for k, angle in enumerate(self.attack, start=1):
            # the control of this step, which the filter knows (equation 10)
            self.motion.attack = float(angle)
            state = filter.predict(state, DT)
            state = filter.update(state, np.ascontiguousarray(self.seen[k][:, index]), sensor).state
            means.append(state.mean)
        return np.array(means)

    def squared(self, estimates: Array) -> Array:
        """Squared errors (STEPS, count, 4)."""
        result: Array = (estimates - self.truth)[1:] ** 2
        return result

    def enkf(self, size: int, rng: np.random.Generator, measured: str = "all") -> Array:
        """Squared errors of an ensemble filter."""
        return self.squared(self.follow(EnsembleKalmanFilter(self.motion, size, rng), measured))


def rms(squared: Array) -> Array:
    """RMS error of each state, (4,)."""
    result: Array = np.sqrt(squared.mean(axis=(0, 1)))
    return result


def judge(count: int, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Both simulations, ensemble sizes, noises and what is measured; and one run of each, for the figures."""
    claims: list[Claim] = []
    fixed = Simulation(np.full(STEPS, ATTACK), Q_SIGMA, count, rng)
    base = rms(fixed.squared(fixed.follow(ExtendedKalmanFilter(fixed.motion))))
    by_size = {size: fixed.enkf(size, rng) for size in SIZES}
    claims += _against("fixed attack, N 300", by_size[300], FIXED_RMS, "section d, fixed attack")
    for i, state in enumerate(STATES):
        claims.append(Claim(f"EKF, RMS of {state}", UNITS[i], None, base[i], source="chosen by us"))
    for words, scale in SCALES.items():
        if words:
            other = Simulation(np.full(STEPS, ATTACK), scale * Q_SIGMA, count, rng)
            label = f"fixed attack, N 300, {words} the process noise"
            claims += _against(label, other.enkf(300, rng), FIXED_RMS, "section d, fixed attack")
    claims += _sizes("fixed attack", {size: rms(squared) for size, squared in by_size.items()}, base, 300)
    changing = Simulation(CHANGING, Q_SIGMA, count, rng)
    others = {size: changing.enkf(size, rng) for size in SIZES}
    turned = rms(changing.squared(changing.follow(ExtendedKalmanFilter(changing.motion))))
    claims += _against("changing attack, N 100", others[100], CHANGING_RMS, "section d, changing attack")
    claims += _sizes("changing attack", {size: rms(squared) for size, squared in others.items()}, turned, 200)
    claims += _measured(fixed, rng) + _limits(fixed, changing) + _as_printed(count, by_size[300], rng)
    shown = {}
    for label, simulation, size in (("fixed attack", fixed, 300), ("changing attack", changing, 100)):
        found = simulation.follow(EnsembleKalmanFilter(simulation.motion, size, rng))
        shown[f"{label}, N {size}"] = simulation.truth[:, 0], found[:, 0]
    return claims, shown


def draw(panels: Any, shown: dict[str, tuple[Array, Array]]) -> None:
    """Both figures 4: angle of climb, speed, and height over distance, a row of panels for each simulation."""
    for row, (label, both) in zip(panels, shown.items(), strict=True):
        for path, style, name in zip(both, ("C2", "C3--"), ("real", "EnKF"), strict=True):
            for panel, i in zip(row, (0, 1), strict=False):
                panel.plot(path[:, i], style, label=name)
            row[2].plot(path[:, 2], path[:, 3], style)
        row[0].set(title=f"climb (rad), figure 4, {label}", xlabel="step")
        row[1].set(title="speed (m/s)", xlabel="step")
        row[2].set(title="height over distance (m)")
        row[0].legend(fontsize=7)


def _as_printed(count: int, other: Array, rng: np.random.Generator) -> list[Claim]:
    """The fixed attack with equation 1 as printed, against our equations; and equation 21 as printed, one step."""
    printed = Simulation(np.full(STEPS, ATTACK), Q_SIGMA, count, rng, AsPrinted)
    values, base = rms(printed.enkf(300, rng)), rms(other)
    claims = [
        Claim(f"equation 1 as printed, N 300: RMS of {state} / with ours", UNITS[i], None, values[i] / base[i], None,
              (0.9, 1.1), source="equation 1; 10 % chosen by us")
        for i, state in enumerate(STATES)
    ]  # fmt: skip
    gained = DT * float(printed.motion.rates(START[None])[0, 1])
    claims.append(Claim("speed after a step by equation 21 as printed, gamma_k for v_k", "m/s", None, START[0] + gained,
                        source="equation 21"))  # fmt: skip
    return claims


def _against(label: str, squared: Array, paper: tuple[float, ...], source: str) -> list[Claim]:
    claims = []
    for i, (state, figure, ours) in enumerate(zip(STATES, paper, rms(squared), strict=True)):
        low, high = mean_interval(squared[:, :, i].mean(axis=0))
        claims.append(
            Claim(f"{label}: RMS of {state}", UNITS[i], figure, ours, (max(low, 0) ** 0.5, high**0.5),
                  (0.9 * figure, 1.1 * figure), source=f"{source}; band of 10 % chosen by us")
        )  # fmt: skip
    return claims


def _sizes(label: str, by_size: dict[int, Array], base: Array, best: int) -> list[Claim]:
    claims = []
    for size, values in by_size.items():
        for i, state in enumerate(STATES):
            if size >= 100:
                claims.append(Claim(f"{label}: N {size} / EKF, RMS of {state}", "", None, values[i] / base[i], None,
                                    (0.93, 1.07), source="7 % chosen by us"))  # fmt: skip
            elif size == 10:
                claims.append(Claim(f"{label}: N 10 / N 100, RMS of {state}", "", None, values[i] / by_size[100][i],
                                    None, (1.0, None), source="chosen by us"))  # fmt: skip
    where = "abstract: best with 300 members" if best == 300 else "abstract: best with 200 members"
    for size in by_size:
        if size >= 100 and size != best:
            ratio = float(np.mean(by_size[best] / by_size[size]))
            claims.append(Claim(f"{label}: N {best} / N {size}, mean of the states", "", None, ratio, None,
                                (None, 0.98), source=f"{where}; 2 % chosen by us"))  # fmt: skip
    return claims


def _measured(fixed: Simulation, rng: np.random.Generator) -> list[Claim]:
    squared = {measured: fixed.enkf(300, rng, measured) for measured in MEASURED}

    def ratio(i: int, worse: str, better: str, **how: Any) -> Claim:
        top, bottom = squared[worse][..., i], squared[better][..., i]
        value, interval = float(np.sqrt(top.mean() / bottom.mean())), ratio_interval(top, bottom, rng)
        return Claim(f"RMS of {STATES[i]}: measuring {worse} / {better}", "", None, value, interval, **how)

    least = {"band": (1.0, None), "source": "abstract: far better if all is measured"}
    claims = [ratio(i, *pair, **least) for i in (0, 1) for pair in (("x, h", "all"), ("x", "x, h"))]
    return claims + [ratio(i, "x", "all", source="equation 22") for i in (2, 3)]


def _limits(*simulations: Simulation) -> list[Claim]:
    claims = []
    for label, simulation in zip(("fixed attack", "changing attack"), simulations, strict=True):
        speeds, k = simulation.truth[..., 1], simulation.motion.aerodynamics
        lift = 0.5 * np.polyval(k.density, simulation.truth[:-1, :, 3]) * speeds[:-1] ** 2 * k.area
        load = lift * np.polyval(k.lift, simulation.attack)[:, None] / (k.mass * k.gravity)
        for what, value in (("least", speeds.min()), ("largest", speeds.max())):
            claims.append(Claim(f"{label}: {what} speed of all runs", "m/s", None, float(value), None,
                                LIMITS["speed"], source="equation 4; limits chosen by us"))  # fmt: skip
        for what, value in (("least", load.min()), ("largest", load.max())):
            claims.append(Claim(f"{label}: {what} L / (m g) of all runs", "", None, float(value),
                                source="equation 4; the paper gives no limit"))  # fmt: skip
        heights = simulation.truth[..., 3]
        for what, value in (("least", heights.min()), ("largest", heights.max())):
            claims.append(Claim(f"{label}: {what} height of all runs", "m", None, float(value),
                                source="equation 4; the paper gives no limit"))  # fmt: skip
        under = (heights < 0).any(axis=0).tolist()
        claims.append(Claim(f"{label}: runs that come below the ground", "%", None, 100.0 * float(np.mean(under)),
                            wilson(under), source="equation 4; the paper gives no limit"))  # fmt: skip
    claims.append(Claim("thrust", "N", None, THRUST, None, LIMITS["thrust"], source="equation 4; limits chosen by us"))
    return claims
