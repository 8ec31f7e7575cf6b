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
    about_filters, flown = ensemble.judge(40 if quick else 400, rng)
    return about_paths + about_filters, (drawn, flown)


def draw(figure: Any, shown: Any) -> None:
    """Figures 2 and 3 above both figures 4."""
    above, below = figure.subfigures(2, 1)
    flight_paths.draw(*above.subplots(1, 2), shown[0])
    ensemble.draw(below.subplots(2, 3), shown[1])


program = partial(main, "papers.dubins_enkf", experiment, __doc__, figure=(draw, (11, 9)))


if __name__ == "__main__":
    raise SystemExit(program())
