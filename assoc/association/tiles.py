"""One huge scan in tiles of space: each built and solved where it is, with one certificate for the whole.

A tile has its own measurements and those around it that may be in one tuple with them. A component whose measurements
are all the tile's own is complete, and is solved there. Tuples of other components go back, each from the one tile that
owns its first measurement, and are solved together. So costs and bounds of all parts can be added.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from assoc._system.engine import spread
from assoc._types import Array
from assoc.costs import build_problem
from assoc.costs.build import GATE_PROBABILITY
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.positions import positions_of_scan
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.solution import Solution
from assoc.solvers.assign import assign


def targets_of(problem: AssignmentProblem, solution: Solution) -> tuple[Array, Array]:
    """Tuples that are targets, and their costs."""
    number = np.count_nonzero(solution.tuples, axis=1)
    alone_but_real = (number == 1) & (problem.costs[solution.indices] < 0)
    real = (number >= 2) | alone_but_real
    return solution.tuples[real], problem.costs[solution.indices[real]]


_MARGIN = 1.5
"""Reach of gates beyond that of the linearised covariances."""
_FREEDOM = 3


class Tile(NamedTuple):
    """A part of a scan."""

    scan: Scan
    rows: tuple[Array, ...]
    """Numbers of its measurements in the whole scan, from 0."""
    belongs: tuple[Array, ...]
    """Which of them are its own."""


class TileAnswer(NamedTuple):
    """What is certain in a tile, and what is left to all."""

    tuples: Array
    """Targets (K, S), 1-based in the whole scan."""
    costs: Array
    cost: float
    lower_bound: float
    left: Array
    """Candidate tuples that are left (M, S)."""
    left_costs: Array
    runtime: float


class SolveTile:
    """Builds and solves a tile, in any process."""

    def __init__(self, plan: Any, scene: Scene) -> None:
        # the other scans are not needed
        self._plan, self._scene = replace(plan, sources=(), watch=None), without_scans(scene)

    def __call__(self, tile: Tile) -> TileAnswer:
        """Solve it."""
        problem = build_problem(self._scene, tile.scan, **self._plan.gating)
        found = problem.tuples
        whole = np.zeros_like(found)
        belongs = np.ones(found.shape, dtype=bool)
        for s, (rows, mine) in enumerate(zip(tile.rows, tile.belongs, strict=True)):
            there = found[:, s] > 0
            whole[there, s] = rows[found[there, s] - 1] + 1
            belongs[there, s] = mine[found[there, s] - 1]
        complete = np.zeros(len(found), dtype=bool)
        for component in problem.components():
            complete[component] = belongs[component].all()
        # each tuple that is left comes from the tile of its first measurement
        first = belongs[np.arange(len(found)), (found > 0).argmax(axis=1)]
        left = ~complete & first
        certain = AssignmentProblem(found[complete], problem.costs[complete], problem.sizes)
        answer = _solved(self._plan, certain)
        targets, costs = targets_of(certain, answer)
        for s, rows in enumerate(tile.rows):
            targets[:, s] = np.append(0, rows + 1)[targets[:, s]]
        left_costs = problem.costs[left]
        return TileAnswer(targets, costs, answer.cost, answer.lower_bound, whole[left], left_costs, answer.runtime)


def _solved(plan: Any, problem: AssignmentProblem) -> Solution:
    common: Any = {"seed": plan.seed, "time_limit": plan.time_limit}
    return assign(problem, plan.solver, **common, **plan.parameters)


def without_scans(scene: Scene) -> Scene:
    """The sensors and the region of a scene."""
    empty = [[np.zeros((0, sensor.dim)) for sensor in scene.sensors]]
    return Scene(scene.sensors, scene.times[:1], empty, region=scene.region)


def solve_in_tiles(
    plan: Any, scene: Scene, scan: Scan, count: int, *, jobs: int = 1, scheduler: str | None = None
) -> tuple[Solution, Array, Array]:
    """Associate a scan in about so many tiles, as an `assoc.association.plan.Plan` says.

    Returns the solution, whose cost and bound are those of the whole scan and whose `indices` are empty, since the
    problem is nowhere in one piece; targets (K, S) and costs (K,). Refused are measurements with times of their own,
    and gates without a reach: probability 1, density "auto", all tuples.
    """
    gating = plan.gating
    probability = gating.get("gate_probability", GATE_PROBABILITY)
    auto = gating.get("target_density") == "auto"
    more = plan.kbest or plan.gate_loss or plan.marginals
    if scan.times is not None or probability == 1 or auto or gating.get("all_tuples") or more:
        raise InvalidInputError(
            "tiles: expected measurements of one instant, a gate probability below 1, no target_density 'auto', and "
            "one association of each scan without its gate loss or probabilities"
        )
    answers = list(
        spread(SolveTile(plan, scene), tiles_of(scene, scan, count, probability), jobs=jobs, scheduler=scheduler,
               ordered=False)
    )  # fmt: skip
    left = np.concatenate([answer.left for answer in answers])
    left_costs = np.concatenate([answer.left_costs for answer in answers])
    # the order in which tiles arrive must not matter
    order = np.lexsort(left.T[::-1])
    rest = AssignmentProblem(left[order], left_costs[order], scan.sizes)
    last = _solved(plan, rest)
    parts = [(answer.tuples, answer.costs) for answer in answers] + [targets_of(rest, last)]
    targets, costs = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort(targets.T[::-1])
    targets, costs = targets[order], costs[order]
    alone = []
    for s, size in enumerate(scan.sizes.tolist()):
        numbers = np.setdiff1d(np.arange(1, size + 1), targets[:, s])
        singles = np.zeros((len(numbers), len(scan.sizes)), dtype=np.int32)
        singles[:, s] = numbers
        alone.append(singles)
    chosen = np.concatenate([targets, *alone])
    solution = replace(
        last,
        tuples=chosen[np.lexsort(chosen.T[::-1])],
        indices=np.zeros(0, dtype=np.intp),
        cost=float(np.sort([last.cost, *(answer.cost for answer in answers)]).sum()),
        lower_bound=float(np.sort([last.lower_bound, *(answer.lower_bound for answer in answers)]).sum()),
        runtime=last.runtime + sum(answer.runtime for answer in answers),
        duals=(),
        trace=(),
    )
    return solution, targets, costs


def tiles_of(scene: Scene, scan: Scan, count: int, probability: float) -> Iterator[Tile]:
    """Tiles with about equally many measurements of their own; none is in two, and none is left out."""
    of_sensors, reach = [], []
    limit = _MARGIN * math.sqrt(chi_square_quantiles(float(probability), _FREEDOM)[_FREEDOM])
    for s in range(len(scene.sensors)):
        positions, covariances = positions_of_scan(scene, scan, s)
        of_sensors.append(positions[:, :2])
        reach.append(limit * np.sqrt(np.linalg.eigvalsh(covariances[:, :2, :2])[:, -1]))
    owner = np.repeat(np.arange(len(of_sensors)), scan.sizes)
    points, far = np.concatenate(of_sensors), np.concatenate(reach)
    number = np.concatenate([np.arange(size) for size in scan.sizes.tolist()])
    for rows in _parts(points, np.arange(len(points)), count):
        low, high = points[rows].min(axis=0), points[rows].max(axis=0)
        off = np.maximum(np.maximum(low - points, points - high), 0.0)
        near = np.hypot(*off.T) <= far + far[rows].max()
        mine = np.zeros(len(points), dtype=bool)
        mine[rows] = True
        chosen = [np.flatnonzero(near & (owner == s)) for s in range(len(of_sensors))]
        numbers = tuple(number[which] for which in chosen)
        parts = tuple(z[which] for z, which in zip(scan.measurements, numbers, strict=True))
        crowd = None if scan.clutter is None else tuple(
            density[of] for density, of in zip(scan.clutter, numbers, strict=True)
        )  # fmt: skip
        part = Scan(scan.index, scan.time, parts, sectors=scan.sectors, clutter=crowd)
        yield Tile(part, numbers, tuple(mine[which] for which in chosen))


def _parts(points: Array, rows: Array, count: int) -> Iterator[Array]:
    """Rows in `count` parts of about one size, halved along their longer side."""
    if count <= 1 or len(rows) < 2:
        if len(rows):
            yield rows
        return
    axis = int(np.argmax(np.ptp(points[rows], axis=0)))
    order = rows[np.argsort(points[rows, axis], kind="stable")]
    cut = len(order) * (count // 2) // count
    yield from _parts(points, order[:cut], count // 2)
    yield from _parts(points, order[cut:], count - count // 2)
