"""Dubins paths and the ensemble Kalman filter for an unmanned aircraft.

Turning radius 100 m, an obstacle of radius 30 m; filters: 400 runs of 120 steps, 10 to 500 members. The paper's path
around the obstacle turns at the obstacle's radius, tighter than the aircraft can, and has kinks. Its claim that the
filter improves with the number of members up to 200 or 300 does not hold: above 100 there is no trend. The process
noise is chosen by us as the paper's reported errors, rounded.
"""

from functools import partial
from typing import Any

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.papers.dubins_enkf import ensemble, flight_paths


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Check the paths, then compare ensemble sizes, noises and what is measured; --quick has fewer runs."""
    about_paths, drawn = flight_paths.judge()
    return about_paths + ensemble.judge(40 if quick else 400, rng), drawn


program = partial(main, "papers.dubins_enkf", experiment, __doc__, figure=(flight_paths.draw, (9, 4)))


if __name__ == "__main__":
    raise SystemExit(program())
