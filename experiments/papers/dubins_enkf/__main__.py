"""Dubins paths and the ensemble Kalman filter for an unmanned aircraft.

    python -m experiments.papers.dubins_enkf [--quick] [--seed N] [--json FILE] [--figure FILE]

Turning radius 100 m, an obstacle of radius 30 m; filters: 400 runs of 120 steps, 10 to 500 members. The paper's path
around the obstacle turns at the obstacle's radius, tighter than the aircraft can, and has kinks. Its claim that the
filter improves with the number of members up to 200 or 300 does not hold: above 100 there is no trend. The process
noise is chosen by us as the paper's reported errors, rounded.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.papers.dubins_enkf import ensemble, flight_paths


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Check the paths, then compare ensemble sizes, noises and what is measured; --quick has fewer runs."""
    about_paths, drawn = flight_paths.judge()
    about_filters, shown = ensemble.judge(40 if quick else 400, rng)
    return about_paths + about_filters, (drawn, shown)


def draw(figure: Any, shown: Any) -> None:
    """Draw figures 2 to 4 of the paper with ours, and the error over the number of members."""
    from matplotlib.ticker import NullLocator

    drawn, (examples, ratios) = shown
    panels = figure.subplots(3, 3)
    flight_paths.draw(panels[0, 0], panels[0, 1], drawn)
    members = panels[0, 2]
    for i, state in enumerate(ensemble.STATES):
        members.semilogx(list(ratios), [r[i] for r in ratios.values()], "o-", label=state)
    members.axhline(1.0, color="grey", linewidth=0.8)
    members.set(xlabel="members N", ylabel="RMS / that of the EKF", title="all four states measured")
    members.set_xticks(list(ratios), [str(size) for size in ratios], fontsize=7)
    members.xaxis.set_minor_locator(NullLocator())
    members.legend(fontsize=8)
    for row, (name, (truth, estimate)) in zip(panels[1:], examples.items(), strict=True):
        for panel, column, what in ((row[0], 0, "climb angle (rad)"), (row[1], 1, "speed (m/s)")):
            panel.plot(truth[:, column], "C2", label="truth")
            panel.plot(estimate[:, column], "C0--", label="EnKF")
            panel.set(xlabel="step", ylabel=what, title=f"{name} attack, as figure 4")
        row[2].plot(truth[:, 2], truth[:, 3], "C2", label="truth")
        row[2].plot(estimate[:, 2], estimate[:, 3], "C0--", label="EnKF")
        row[2].set(xlabel="distance (m)", ylabel="height (m)", title=f"{name} attack, as figure 4")
        row[0].legend(fontsize=8)


program = partial(main, "papers.dubins_enkf", experiment, __doc__, figure=(draw, (14, 10)))


if __name__ == "__main__":
    raise SystemExit(program())
