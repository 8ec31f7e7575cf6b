"""Costs of candidate tuples, and how the chosen ones fill their gates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._parameters import is_whole
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.association.association import Association
from assoc.association.scan import ScanAssociation
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, legend
from assoc.plotting.colours import BLACK, BLUE, GREY, VERMILION
from assoc.plotting.measured import scan_of
from assoc.problem import AssignmentProblem
from assoc.scene.scene import Scene
from assoc.solution import Solution

_SPREAD = 0.7


@explains_wrong_types
def plot_costs(problem: AssignmentProblem, solution: Solution | None = None, *, ax: Any = None) -> Any:
    """Draw the cost of each candidate tuple by its number of measurements, and which were chosen.

    Parameters
    ----------
    problem : AssignmentProblem
    solution : Solution, optional
        A solution of this problem.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        The solution belongs to another problem.
    """
    if solution is not None and not belongs(solution, problem):
        raise InvalidInputError("solution: is not one of this problem")
    ax = axes_or_new(ax)
    number = np.count_nonzero(problem.tuples, axis=1)
    across = number.astype(np.float64)
    for count in np.unique(number):
        rows = np.flatnonzero(number == count)
        # side by side in the order of costs, so that the width shows their number
        order = np.argsort(problem.costs[rows], kind="stable")
        across[rows[order]] += _SPREAD * ((np.arange(rows.size) + 0.5) / rows.size - 0.5)
    ax.plot(across, problem.costs, ".", color=GREY, alpha=0.5, markersize=4, label="candidate tuples")
    if solution is not None:
        rows = solution.indices
        style = {"markerfacecolor": "none", "markeredgewidth": 1.5}
        ax.plot(across[rows], problem.costs[rows], "o", color=VERMILION, markersize=7, label="chosen", **style)
    ax.axhline(0.0, color=BLACK, linewidth=0.8, linestyle="--", label="false alarm")
    ax.set_xticks(np.unique(number) if number.size else [])
    ax.set_xlabel("measurements in the tuple (number)")
    ax.set_ylabel("cost (nats)")
    ax.grid(axis="y", alpha=0.25, linewidth=0.6)
    legend(ax)
    return ax


def belongs(solution: Solution, problem: AssignmentProblem) -> bool:
    """Whether a solution's indices match its tuples in this problem; after another gating they may not."""
    rows = solution.indices
    inside = not rows.size or int(rows.max()) < problem.num_tuples
    return bool(inside and np.array_equal(problem.tuples[rows], solution.tuples))


@explains_wrong_types
def plot_gates(
    scene: Scene,
    association: Association | Sequence[ScanAssociation],
    *,
    gate_probability: float = 0.999,
    bins: int = 20,
    ax: Any = None,
) -> Any:
    """Draw a histogram of the chosen tuples' residuals, as the probability that those of a true tuple are smaller.

    If noise and model are right and the tuples true, this probability is uniform and the bars are level with the line.
    A peak at the right means that the stated noise is too small or tuples are wrong, one at the left that the stated
    noise is too large.

    Parameters
    ----------
    scene : Scene
    association : Association or sequence of ScanAssociation
        Association of this scene.
    gate_probability : float
        Probability of a true tuple inside the gate.
    bins : int
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        Measurements of the scene have times of their own: their gates depend on predicted motion.
    """
    from scipy.special import gammainc

    if not is_whole(bins, 1):
        raise InvalidInputError(f"bins: expected a whole number >= 1, got {bins!r}")
    scans = association.scans if isinstance(association, Association) else association
    parts = [(np.zeros(0), np.zeros(0)), *(_squares(scene, scan) for scan in scans)]
    ax = axes_or_new(ax)
    squares, freedom = (np.concatenate(column) for column in zip(*parts, strict=True))
    share = gammainc(freedom / 2.0, squares / 2.0)
    ax.hist(share, bins=bins, range=(0.0, 1.0), color=BLUE, edgecolor="white", label=f"{share.size} tuples")
    ax.axhline(share.size / bins, color=BLACK, linewidth=1.0, linestyle="--", label="expected of true tuples")
    ax.axvline(gate_probability, color=VERMILION, linewidth=1.4, linestyle=":", label=f"gate, {gate_probability:g}")
    ax.set_xlim(0.0, 1.02)
    ax.set_xlabel("share of the gate (probability)")
    ax.set_ylabel("tuples (number)")
    legend(ax)
    return ax


def _squares(scene: Scene, found: ScanAssociation) -> tuple[Array, Array]:
    """Normalised squared residuals of the targets, and their degrees of freedom (targets with 0 left out)."""
    scan = scan_of(scene, found)
    if scan.times is not None:
        raise InvalidInputError(
            f"scene: scan {scan.index} has measurements with times of their own, whose gates are of predicted motion"
        )
    total, freedom = np.zeros(len(found.targets)), np.zeros(len(found.targets))
    heights = np.zeros(len(found.targets), dtype=np.bool_)
    for s, sensor in enumerate(scene.sensors):
        rows = np.flatnonzero(found.targets[:, s])
        if not rows.size or found.positions is None:
            continue
        sensor = sensor.position_part
        measured = scan.measurements[s][found.targets[rows, s] - 1][:, : sensor.dim]
        nu = sensor.residual(measured, sensor.measure(found.positions[rows]))
        total[rows] += np.einsum("ni,ij,nj->n", nu, np.linalg.inv(sensor.covariance), nu)
        freedom[rows] += sensor.dim
        heights[rows] |= sensor.dim == 3
    freedom -= np.where(heights, 3, 2)
    return total[freedom > 0], freedom[freedom > 0]
