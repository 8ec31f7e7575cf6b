"""The paper's own simulations: tables 4.1 to 4.3, figures 4.1 to 4.10, with its model (4.1 to 4.15).

The target stands 20 m away, 100 steps of 0.00001 s. The paper states sigmas (0.003 m, 0.0261799 rad) and, apart from
them, R_k = 0.00002 I (table 4.2): it cannot have used both for the same thing, so each reading is a row.

    sigmas      noise and both filters use the sigmas
    R_k         noise and both filters use R_k
    mixed       noise and the modified filter use the sigmas, the EKF uses R_k: the reading nearest to its ratio
    moving      as "sigmas", but the target flies with the velocity of table 4.1, which the paper's model does not do
    printed     as "sigmas", with A P + P A' for A P A' in both filters, as tables 2.2 and 2.3 have it
    printed, mixed      the same with the sensors of "mixed"

The start is drawn with P_0 of table 4.2, its variance. The modified filter's correction assumes that |phi~ tan phi|,
phi~ the innovation of the elevation, is much less than 1 (below equation 2.30).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter, Gaussian, LinearMeasurement, ModifiedEKF, UnitRates
from assoc.filters.base import Filter
from assoc.filters.measurement import Measurement
from assoc.filters.motion.models import Motion
from assoc.sensors import Radar3D
from experiments.common.claims import Claim
from experiments.common.command import rmse, rmse_interval
from experiments.filters.b1 import radar_of, ratio_interval

START = np.array([15.0, 12.0, 5.0, -60.0, -70.0, -40.0])
SIGMAS = np.array([0.003, 0.0261799, 0.0261799])
P0, Q, R, DT, STEPS = 0.05, 0.0001, 0.00002, 0.00001, 100
VARIABLES = ("x", "y", "z", "Vx", "Vy", "Vz")
PRINTED = {
    "EKF": (0.0094249, 0.0150247, 0.0111491, 0.01824580, 0.0107461, 0.0115598),
    "modified": (0.0088085, 0.0073667, 0.0093434, 0.0114886, 0.01008190, 0.0105467),
}
"""Section 4.4.1, below figures 4.1 to 4.6: the RMSE that table 4.3 gathers."""
ENDS = {"real": (15.293, 11.288, 4.591), "EKF": (15.311, 11.413, 4.553), "modified": (15.291, 11.716, 4.374)}
"""Below figures 4.8 to 4.10: positions after 100 steps of simulation 2."""
READINGS = ("sigmas", "R_k", "mixed", "moving", "printed", "printed, mixed")


@dataclass(frozen=True)
class Runs:
    """One reading: truth (STEPS + 1, runs, 6), and the estimates of each filter, of the same shape."""

    truth: Array
    estimates: dict[str, Array]
    innate: float
    """Mean of range * (prior's variance of the azimuth) / sigma_range over the steps of the EKF."""
    steepness: Array
    """|phi~ tan phi| of the modified filter in every step of every run."""

    def squared(self, name: str) -> Array:
        """Squared errors (STEPS, runs, 6)."""
        errors: Array = (self.estimates[name] - self.truth)[1:] ** 2
        return errors


def motion_of(reading: str) -> Motion:
    """Return the paper's model, or for "moving" constant velocity with the process noise of 1 m/s^2."""
    return ConstantVelocity(1.0) if reading == "moving" else UnitRates(Q * np.eye(6))


def draw_truth(motion: Motion, count: int, rng: np.random.Generator) -> Array:
    """True states of independent runs, started N(table 4.1, P_0), (STEPS + 1, runs, 6)."""
    states = [START + P0**0.5 * rng.standard_normal((count, 6))]
    root = np.linalg.cholesky(motion.noise(states[0], DT)[0] + 1e-30 * np.eye(6))
    for _ in range(STEPS):
        states.append(motion.propagate(states[-1], DT) + rng.standard_normal((count, 6)) @ root.T)
    return np.stack(states)


def simulate(reading: str, count: int, rng: np.random.Generator) -> Runs:
    """Simulation 1: range, azimuth and elevation are measured."""
    motion, by_sigmas, by_r = motion_of(reading), radar_of(SIGMAS), radar_of(np.full(3, R**0.5))
    true_sensor = by_r if reading == "R_k" else by_sigmas
    filters: dict[str, tuple[Filter[Gaussian], Radar3D]] = {
        "EKF": (ExtendedKalmanFilter(motion), by_sigmas if reading in ("sigmas", "moving", "printed") else by_r),
        "modified": (ModifiedEKF(motion, simplified=True), true_sensor),
        "full": (ModifiedEKF(motion), true_sensor),
    }
    truth = draw_truth(motion, count, rng)
    exact = true_sensor.measure(truth.reshape(-1, 6)[:, :3]).reshape(*truth.shape[:2], 3)
    seen = exact + rng.standard_normal(exact.shape) * true_sensor.noise
    estimates, innate, steep = {}, 0.0, np.zeros(0)
    for name, (filter, sensor) in filters.items():
        estimates[name], spread, tilted = follow(filter, sensor, seen, printed=reading.startswith("printed"))
        if name == "EKF":
            innate = spread * float(np.linalg.norm(START[:3])) / float(sensor.noise[0])
        elif name == "modified":
            steep = tilted
    return Runs(truth, estimates, innate, steep)


def follow(
    filter: Filter[Gaussian], sensor: Measurement, seen: Array, *, printed: bool = False
) -> tuple[Array, float, Array]:
    """Estimates (STEPS + 1, runs, 6) from measurements (STEPS + 1, runs, 3), mean prior variance of z[1], steepness.

    With `printed` the covariance of a prediction is A P + P A' + Q.
    """
    state = filter.start(Gaussian(np.tile(START, (seen.shape[1], 1)), P0 * np.eye(6)))
    means, spreads, steep = [state.mean], [], []
    for z in seen[1:]:
        before, state = state, filter.predict(state, DT)
        if printed:
            AP = filter.motion.jacobian(before.mean, DT) @ before.covariance
            state = Gaussian(state.mean, AP + AP.transpose(0, 2, 1) + filter.motion.noise(before.mean, DT))
        own = state.covariance
        phi = np.arctan2(state.mean[:, 2], np.hypot(*state.mean[:, :2].T))
        steep.append(np.abs((z[:, 2] - phi) * np.tan(phi)))
        across = np.array([-state.mean[:, 1], state.mean[:, 0]]) / np.hypot(*state.mean[:, :2].T) ** 2
        spreads.append(float(np.einsum("ib,bij,jb->b", across, own[:, :2, :2], across).mean()))
        state = filter.update(state, z, sensor).state
        means.append(state.mean)
    return np.stack(means), float(np.mean(spreads)), np.stack(steep)


def judge(count: int, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Simulation 1 in every reading, variable by variable, then simulation 2; and both, for their figures."""
    claims: list[Claim] = []
    shown: list[Runs] = []
    for reading in READINGS:
        runs = simulate(reading, count, rng)
        shown = shown or [runs]
        label = f"simulation 1, reading {reading}"
        short, plain = (runs.squared(name)[..., :3].sum(axis=-1) for name in ("modified", "EKF"))
        for i, variable in enumerate(VARIABLES):
            unit = "m" if i < 3 else "m/s"
            for name in ("EKF", "modified"):
                squared = runs.squared(name)[..., i]
                claims.append(
                    Claim(f"{label}: RMSE of {variable}, {name}", unit, PRINTED[name][i], rmse(squared),
                          rmse_interval(squared), (0.9 * PRINTED[name][i], 1.1 * PRINTED[name][i]),
                          source=f"table 4.3 (figure 4.{i + 1}); band of 10 % chosen by us")
                )  # fmt: skip
        paper = float(np.linalg.norm(PRINTED["modified"][:3]) / np.linalg.norm(PRINTED["EKF"][:3]))
        claims.append(
            Claim(f"{label}: modified / EKF, RMSE of the position", "", round(paper, 2), rmse(short) / rmse(plain),
                  ratio_interval(short, plain, rng), (None, 0.99),
                  source="ratio of the RMSE in table 4.3, positions; below 1 is the paper's conclusion 2")
        )  # fmt: skip
        full = runs.squared("full")[..., :3].sum(axis=-1)
        claims.append(
            Claim(f"{label}: full form / EKF, RMSE of the position", "", None, rmse(full) / rmse(plain),
                  ratio_interval(full, plain, rng), source="chosen by us")
        )  # fmt: skip
        claims.append(
            Claim(f"{label}: r * prior variance of azimuth / sigma_range, mean", "", None, runs.innate,
                  source="chosen by us")
        )  # fmt: skip
        claims.append(
            Claim(f"{label}: largest |phi~ tan phi| of the modified filter", "", None, float(runs.steepness.max()),
                  None, (None, 0.1), source="equations 2.30 and 2.31, the text between them; 0.1 chosen by us")
        )  # fmt: skip
        noise = SIGMAS if reading != "R_k" else np.full(3, R**0.5)
        beta = float(np.linalg.norm(START[:3]) * noise[1] ** 2 / noise[0])
        claims.append(Claim(f"{label}: beta", "", None, beta, source="table 4.2; beta chosen by us"))
    low, high = min(PRINTED["modified"]), max(PRINTED["modified"])
    claims += [
        Claim("simulation 1: smallest printed RMSE of the modified EKF, x 100", "%", 0.77, 100 * low, None,
              (0.765, 0.775), source="abstract and section 4.4.1 against its table 4.3"),
        Claim("simulation 1: largest printed RMSE of the modified EKF, x 100", "%", 1.15, 100 * high, None,
              (1.145, 1.155), source="abstract and section 4.4.1 against its table 4.3"),
        Claim("simulation 1: smallest printed RMSE / root of Q_k", "", None, low / Q**0.5, source="tables 4.2 and 4.3"),
        Claim("simulation 1: largest printed RMSE / root of Q_k", "", None, max(PRINTED["EKF"]) / Q**0.5,
              source="tables 4.2 and 4.3"),
    ]  # fmt: skip
    second, places = simulation_2(count, rng)
    return claims + second, (shown[0], places)


def simulation_2(count: int, rng: np.random.Generator) -> tuple[list[Claim], Runs]:
    """x, y and z are measured with R_k; the modified EKF has nothing to modify there."""
    motion = UnitRates(Q * np.eye(6))
    truth = draw_truth(motion, count, rng)
    place = LinearMeasurement(np.eye(3, 6), R * np.eye(3))
    seen = truth[..., :3] + R**0.5 * rng.standard_normal((*truth.shape[:2], 3))
    estimates, _, steep = follow(ExtendedKalmanFilter(motion), place, seen)
    runs = Runs(truth, {"EKF": estimates}, 0.0, steep)
    start, spread = START[:3] + DT * STEPS * motion.rates(START[None])[0, :3], (P0 + STEPS * Q) ** 0.5
    claims = []
    for i, axis in enumerate("xyz"):
        moved = truth[-1, :, i]
        claims.append(
            Claim(f"simulation 2: {axis} of the target after {STEPS} steps", "m", ENDS["real"][i], float(moved.mean()),
                  (float(start[i] - 2 * spread), float(start[i] + 2 * spread)),
                  holds=bool(abs(ENDS["real"][i] - start[i]) <= 2 * spread),
                  source="section 4.4.2, figure 4.8; within two standard deviations, chosen by us")
        )  # fmt: skip
        squared = runs.squared("EKF")[..., i]
        claims.append(
            Claim(f"simulation 2: error of {axis} after {STEPS} steps, EKF", "m", abs(ENDS["EKF"][i] - ENDS["real"][i]),
                  rmse(squared[-1]), holds=bool(abs(ENDS["EKF"][i] - ENDS["real"][i]) <= 2 * rmse(squared[-1])),
                  source="section 4.4.2, figure 4.9 less figure 4.8; within two RMSE, chosen by us")
        )  # fmt: skip
    return claims, runs


def draw(figure: Any, shown: tuple[Runs, Runs]) -> None:
    """Figures 4.1 to 4.10 with one run of ours; in simulation 2 the modified filter is the EKF."""
    first, second = shown
    styles = {"real": "C2", "EKF": "C0", "modified": "C3--"}
    panels = figure.subplots(2, 4).ravel()
    for panel, i in zip(panels, range(6), strict=False):
        for name, style in styles.items():
            panel.plot((first.truth if name == "real" else first.estimates[name])[:, 0, i], style, label=name)
        panel.set(title=f"{VARIABLES[i]}, as figure 4.{i + 1}", xlabel="step")
    panels[0].legend(fontsize=7)
    for i, variable in enumerate(VARIABLES):
        panels[6].plot(np.abs(first.estimates["modified"] - first.truth)[:, 0, i], label=variable)
    panels[6].set(title="errors of the modified, as figure 4.7", xlabel="step")
    panels[6].legend(fontsize=7)
    for name, path in (("real", second.truth), ("EKF", second.estimates["EKF"])):
        panels[7].plot(*path[:, 0, :2].T, styles[name], label=name)
    panels[7].set(title="x, y of simulation 2, as figures 4.8 to 4.10")
