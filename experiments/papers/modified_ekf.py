"""Modified EKF for a 3-D radar: when it is better than an EKF, and whether its covariances are right.

    python -m experiments.papers.modified_ekf [--quick] [--seed N] [--json FILE] [--figure FILE]

The paper reports 0.77-1.15 % (RMSE x 100) at a range of 20 m. The deciding quantity is
beta = r sigma_angle^2 / sigma_range: with the covariance R_k that the paper states it is 0.09,
and the modified filter cannot differ from an EKF.
Benchmark B1 is chosen where it matters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from assoc.filters import ExtendedKalmanFilter, Gaussian, ModifiedEKF, UnscentedKalmanFilter
from assoc.filters.motion.models import ConstantVelocity
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval, rmse_interval
from experiments.filters.b1 import Runs, Setting, ratio_interval, run

BETAS = (0.02, 0.05, 0.09, 0.25, 0.5, 1.0, 2.3, 4.0)
FILTERS = {"EKF": "EKF", "simplified": "modified EKF, simplified", "full": "modified EKF, full", "UKF": "UKF"}
"""Names in the figure."""

PAPER_SETTING = Setting(
    distance=float(np.hypot(np.hypot(15.0, 12.0), 5.0)),
    elevation=float(np.arctan2(5.0, np.hypot(15.0, 12.0))),
    azimuth=float(np.arctan2(12.0, 15.0)),
    velocity=(-60.0, -70.0, -40.0),
    range_noise=0.003,
    angle_noise=0.0261799,
    interval=1e-5,
    acceleration_noise=1.0,
)
"""Tables 4.1 and 4.2; the state moves with its velocity."""


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Compare EKF, the two modified EKFs and UKF on B1, by beta and in the paper's own setting."""
    count = 60 if quick else 1000
    setting = Setting()
    runs = Runs.draw(setting, count, rng)
    motion = setting.motion
    b1 = {
        "EKF": run(ExtendedKalmanFilter(motion), runs),
        "simplified": run(ModifiedEKF(motion, simplified=True), runs),
        "full": run(ModifiedEKF(motion), runs),
        "UKF": run(UnscentedKalmanFilter(motion), runs),
    }
    claims = [
        Claim("B1: RMSE of the EKF", "m", None, b1["EKF"].rmse, rmse_interval(b1["EKF"].squared)),
        Claim(
            "B1: RMSE, modified EKF simplified as in the paper", "m", None, b1["simplified"].rmse,
            rmse_interval(b1["simplified"].squared),
        ),
        Claim("B1: RMSE, full modified EKF", "m", None, b1["full"].rmse, rmse_interval(b1["full"].squared)),
        Claim("B1: RMSE of a UKF", "m", None, b1["UKF"].rmse, rmse_interval(b1["UKF"].squared)),
        Claim(
            "B1: full modified EKF / EKF (RMSE)", "", None, b1["full"].rmse / b1["EKF"].rmse,
            ratio_interval(b1["full"].squared, b1["EKF"].squared, rng), (0.35, 0.55),
        ),
        Claim(
            "B1: full modified EKF / UKF (RMSE)", "", None, b1["full"].rmse / b1["UKF"].rmse,
            ratio_interval(b1["full"].squared, b1["UKF"].squared, rng), (None, 1.06),
        ),
        Claim(
            "B1: NEES of the full modified EKF (ideal 6)", "", None, float(b1["full"].nees.mean()),
            mean_interval(b1["full"].nees.mean(axis=0)), (None, 9.0),
        ),
        Claim(
            "B1: NEES of the EKF (ideal 6)", "", None, float(b1["EKF"].nees.mean()),
            mean_interval(b1["EKF"].nees.mean(axis=0)),
        ),
    ]  # fmt: skip
    ratios = []
    for beta in BETAS:
        changed = replace(setting, range_noise=setting.distance * setting.angle_noise**2 / beta)
        drawn = Runs.draw(changed, count, rng)
        full, plain = run(ModifiedEKF(motion), drawn), run(ExtendedKalmanFilter(motion), drawn)
        ratios.append(plain.rmse / full.rmse)
        interval = ratio_interval(plain.squared, full.squared, rng)
        if beta < 0.1:
            claims.append(
                Claim(
                    f"beta {beta:g}: full modified EKF / EKF (RMSE)", "", None, 1 / ratios[-1],
                    (1 / interval[1], 1 / interval[0]), (None, 1.02),
                )
            )  # fmt: skip
        else:
            claims.append(Claim(f"beta {beta:g}: EKF / full modified EKF (RMSE)", "", None, ratios[-1], interval))
    claims += _paper_setting(count, rng)
    return claims, (b1, ratios)


def _paper_setting(count: int, rng: np.random.Generator) -> list[Claim]:
    """Run the paper's own numbers: target 20 m away, P_0 = 0.05 I."""
    claims = []
    # the paper states sigmas and, apart from them, R_k: its filters can only have used one of the two
    as_stated = PAPER_SETTING
    by_covariance = replace(as_stated, range_noise=2e-5**0.5, angle_noise=2e-5**0.5)
    for name, setting, figures in (
        ("paper's setting, R_k = 2e-5", by_covariance, (0.0148, 0.0209, 0.71)),
        ("paper's setting, its sigmas", as_stated, (None, None, None)),
    ):
        runs = Runs.draw(setting, count, rng)
        start = Gaussian(runs.truth[1] + 0.05**0.5 * rng.standard_normal((count, 6)), 0.05 * np.eye(6))
        motion = ConstantVelocity(setting.acceleration_noise)
        plain = run(ExtendedKalmanFilter(motion), runs, start)
        short = run(ModifiedEKF(motion, simplified=True), runs, start)
        interval = ratio_interval(short.squared, plain.squared, rng)
        label = f"{name} (beta {setting.beta:.2g})"
        claims += [
            Claim(f"{label}: RMSE, modified", "m", figures[0], short.rmse, rmse_interval(short.squared)),
            Claim(f"{label}: RMSE, EKF", "m", figures[1], plain.rmse, rmse_interval(plain.squared)),
            Claim(f"{label}: modified / EKF", "", figures[2], short.rmse / plain.rmse, interval),
        ]
    return claims


def draw(figure: Any, shown: Any) -> None:
    """Draw errors over time on B1 beside the ratio over beta."""
    from matplotlib.ticker import NullLocator

    b1, ratios = shown
    left, right = figure.subplots(1, 2)
    for name, result in b1.items():
        steps = np.arange(len(result.squared)) + 51
        left.semilogy(steps, np.sqrt(result.squared.mean(axis=1)), label=FILTERS[name])
    left.set(xlabel="step (1 s)", ylabel="RMSE of position (m)", title="B1: 100 km, 1.5 deg, 30 m")
    left.set_yticks([400, 500, 700, 1000, 1500, 2000, 3000], ["400", "500", "700", "1000", "1500", "2000", "3000"])
    left.set_ylim(350, 3500)
    left.legend(loc="lower left", fontsize=8)
    right.loglog(BETAS, ratios, "o-")
    right.axhline(1.0, color="grey", linewidth=0.8)
    right.set(xlabel="beta = r sigma_angle² / sigma_range", ylabel="RMSE, EKF / full modified EKF")
    right.set_title("where the modification pays")
    right.set_xticks(BETAS, [f"{beta:g}" for beta in BETAS])
    right.set_yticks([1, 1.5, 2, 3, 4], ["1", "1.5", "2", "3", "4"])
    for axis in (left.yaxis, right.xaxis, right.yaxis):
        axis.set_minor_locator(NullLocator())


TITLE = "Modified EKF for a 3-D radar"


def program(arguments: list[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    return main("papers.modified_ekf", TITLE, experiment, draw, (11, 4.5), arguments)


if __name__ == "__main__":
    raise SystemExit(program())
