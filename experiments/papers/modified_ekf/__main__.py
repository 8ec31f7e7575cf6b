"""Modified EKF for a 3-D radar: when it is better than an EKF, and whether its covariances are right.

The paper's own setting (paper_setting.py) has a target 20 m away, 1,000 runs. Benchmark B1 is chosen by us where the
modification matters: a target 100 km away, azimuth and elevation of 1.5 deg, range of 30 m, steps of 1 s, 1,000 runs,
the errors of the second half. What decides is beta = r sigma_angle^2 / sigma_range, above about 0.25, and a filter that
does not know the angles much better than one measurement tells them. Accepted on B1, chosen by us before the runs: full
form / EKF 0.35 to 0.55, NEES at most 9, at most 6 % above a UKF; below beta = 0.1 at most 2 % above the EKF.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from assoc.filters import ExtendedKalmanFilter, ModifiedEKF, UnscentedKalmanFilter
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval, rmse_interval
from experiments.filters.b1 import Runs, Setting, ratio_interval, run
from experiments.papers.modified_ekf import paper_setting

CHOSEN = "chosen by us"
BETAS = (0.02, 0.05, 0.09, 0.25, 0.5, 1.0, 2.3, 4.0)


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
            ratio_interval(b1["full"].squared, b1["EKF"].squared, rng), (0.35, 0.55), source=CHOSEN,
        ),
        Claim(
            "B1: full modified EKF / UKF (RMSE)", "", None, b1["full"].rmse / b1["UKF"].rmse,
            ratio_interval(b1["full"].squared, b1["UKF"].squared, rng), (None, 1.06), source=CHOSEN,
        ),
        Claim(
            "B1: NEES of the full modified EKF (ideal 6)", "", None, float(b1["full"].nees.mean()),
            mean_interval(b1["full"].nees.mean(axis=0)), (None, 9.0), source=CHOSEN,
        ),
        Claim(
            "B1: NEES of the EKF (ideal 6)", "", None, float(b1["EKF"].nees.mean()),
            mean_interval(b1["EKF"].nees.mean(axis=0)),
        ),
    ]  # fmt: skip
    for beta in BETAS:
        changed = replace(setting, range_noise=setting.distance * setting.angle_noise**2 / beta)
        drawn = Runs.draw(changed, count, rng)
        full, plain = run(ModifiedEKF(motion), drawn), run(ExtendedKalmanFilter(motion), drawn)
        ratio = plain.rmse / full.rmse
        interval = ratio_interval(plain.squared, full.squared, rng)
        if beta < 0.1:
            claims.append(
                Claim(
                    f"beta {beta:g}: full modified EKF / EKF (RMSE)", "", None, 1 / ratio,
                    (1 / interval[1], 1 / interval[0]), (None, 1.02), source=CHOSEN,
                )
            )  # fmt: skip
        else:
            claims.append(Claim(f"beta {beta:g}: EKF / full modified EKF (RMSE)", "", None, ratio, interval))
    about_setting, shown = paper_setting.judge(count, rng)
    return claims + about_setting, shown


program = partial(main, "papers.modified_ekf", experiment, __doc__, figure=(paper_setting.draw, (14, 7)))


if __name__ == "__main__":
    raise SystemExit(program())
