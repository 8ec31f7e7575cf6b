"""The plan of an association: scans and solver; it can be sent to other processes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._parameters import whole_seed
from assoc._system.compile_time import compile_seconds
from assoc._system.engine import parallel_map
from assoc._text.near import did_you_mean
from assoc.association.association import Association
from assoc.association.scan import ScanAssociation
from assoc.association.source import Source
from assoc.costs import build_problem, positions_and_covariances
from assoc.costs.range_rates import SPEED
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import checked_k, kbest
from assoc.ranking.marginals import marginals
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.aco.pheromone_history import PheromoneHistory, pheromone
from assoc.solvers.assign import assign

GATING = ("gate_probability", "max_tuples", "speed", "target_density", "all_tuples")
"""Options of ``assoc.build_problem``."""

# most scans that are sent to a process at once
_TOGETHER = 64
# tuples whose pheromone is kept
_NODES = 30


@dataclass(frozen=True)
class Plan:
    """How to associate scans, by the options of ``associate``; one plan serves all processes."""

    sources: Sequence[Source]
    solver: str
    seed: int = 0
    time_limit: float | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    gating: Mapping[str, Any] = field(default_factory=dict)
    """Options of ``assoc.build_problem``."""
    kbest: int | None = None
    """Rank the k best associations of each scan (``assoc.kbest``) instead of calling the solver."""
    pheromone: bool = False
    """Solver aco: keep the pheromone of every cycle, on the tuples that have the most of it."""
    marginals: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "seed", whole_seed(self.seed))
        if not isinstance(self.gating, Mapping):
            raise InvalidInputError(f"gating: expected a mapping, got {type(self.gating).__name__}")
        for name in self.gating:
            if name not in GATING:
                near = did_you_mean(name, GATING)
                raise InvalidInputError(f"gating: unknown name {name!r}; {near or 'known: ' + ', '.join(GATING)}")
        if self.kbest is not None:
            checked_k(self.kbest)
        self.all_parameters  # noqa: B018  (checks parameters now, not in the first scan)

    def __reduce__(self) -> Any:
        # another process must be given solvers that were registered in this one
        names = () if self.kbest is not None else (self.solver,)
        return _received, (registry.own(names), tuple(getattr(self, field.name) for field in fields(self)))

    @property
    def all_parameters(self) -> dict[str, Any]:
        """The parameters given and the defaults of the others."""
        if self.kbest is not None:
            return {"k": self.kbest}
        chosen: Any = registry.make_parameters(self.solver, self.parameters)
        return {field.name: getattr(chosen, field.name) for field in fields(chosen)}

    def __call__(self, item: tuple[int, int | Scan]) -> ScanAssociation:
        """Associate scan ``item[1]``, or the scan of that number, of source ``item[0]``."""
        source, scan = self.sources[item[0]], item[1]
        if isinstance(source, AssignmentProblem):
            compiled = compile_seconds()
            solutions, history = self._solve(source, self.seed)
            found = [_of_problem(source, solution) for solution in solutions]
            return self._best(self._with_probabilities(source, found), history, compiled)
        return self.associate(source, scan if isinstance(scan, Scan) else source.scan(scan))

    def associate(self, scene: Scene, scan: Scan) -> ScanAssociation:
        """Associate a scan of the sensors of a scene."""
        compiled = compile_seconds()
        # a seed for each scan that depends on neither the process nor the scans before
        seed = np.random.SeedSequence(entropy=self.seed, spawn_key=(scan.index,))
        problem = build_problem(scene, scan, **self.gating)
        solutions, history = self._solve(problem, seed)
        # a position at another time than the measurements' depends on how fast targets usually fly
        speed = self.gating.get("speed", SPEED)
        scans = [_of_scan(scene, scan, problem, solution, speed) for solution in solutions]
        return self._best(self._with_probabilities(problem, scans), history, compiled)

    def _with_probabilities(self, problem: AssignmentProblem, scans: list[ScanAssociation]) -> list[ScanAssociation]:
        if not self.marginals:
            return scans
        found = marginals(problem, time_limit=self.time_limit)
        around = 2.0 * found.error
        values = np.clip(found.probability + np.multiply.outer([-1.0, 0.0, 1.0], around), 0.0, 1.0).T
        row = {key: number for number, key in enumerate(map(tuple, found.tuples.tolist()))}
        return [
            replace(scan, probabilities=values[[row[key] for key in map(tuple, scan.targets.tolist())]].reshape(-1, 3))
            for scan in scans
        ]

    def problem(self, item: tuple[int, int]) -> AssignmentProblem:
        """The assignment problem of scan ``item[1]`` of source ``item[0]``."""
        source = self.sources[item[0]]
        if isinstance(source, AssignmentProblem):
            return source
        return build_problem(source, source.scan(item[1]), **self.gating)

    def _solve(
        self, problem: AssignmentProblem, seed: int | np.random.SeedSequence
    ) -> tuple[list[Solution], PheromoneHistory | None]:
        if self.kbest is not None:
            return kbest(problem, self.kbest, time_limit=self.time_limit), None
        common: Any = {"seed": seed, "time_limit": self.time_limit}
        if self.pheromone and self.solver == "aco":
            history = pheromone(problem, **common, **self.parameters).top(_NODES)
            return [history.solution], history
        return [assign(problem, self.solver, **common, **self.parameters)], None

    def _best(self, scans: list[ScanAssociation], history: PheromoneHistory | None, compiled: float) -> ScanAssociation:
        """Return the first of ranked associations, which holds all of them, if requested."""
        scans = [replace(ranked, pheromone=history, compile_time=compile_seconds() - compiled) for ranked in scans]
        return scans[0] if self.kbest is None else replace(scans[0], ranked=tuple(scans))

    def items(self) -> list[tuple[int, int]]:
        """All scans of all sources, as (source, scan)."""
        counts = [source.num_scans if isinstance(source, Scene) else 1 for source in self.sources]
        return [(number, k) for number, count in enumerate(counts) for k in range(count)]

    def run(
        self, items: Sequence[tuple[int, int]], jobs: int = 1, scheduler: str | None = None
    ) -> Iterator[ScanAssociation]:
        """Associate scans one after the other, or several at once in processes or on a cluster; results in order."""
        if isinstance(jobs, bool) or not isinstance(jobs, (int, np.integer)) or jobs < 1:
            raise InvalidInputError(f"jobs: expected a whole number >= 1, got {jobs!r}")
        # enough batches that processes end at about the same time
        together = max(1, min(_TOGETHER, len(items) // (16 * int(jobs))))
        plan = self
        work: Sequence[tuple[int, int | Scan]] = items
        if jobs > 1 and scheduler is None and self.gating.get("target_density") != "auto":
            # a process is sent the scans that it solves; "auto" is found from all of them
            bare = [_without_scans(source) if isinstance(source, Scene) else source for source in self.sources]
            plan = replace(plan, sources=tuple(bare))
            work = [(number, self._scan(number, k)) for number, k in items]
        return parallel_map(plan, work, jobs=int(jobs), scheduler=scheduler, together=together, here=True)

    def _scan(self, number: int, k: int) -> int | Scan:
        source = self.sources[number]
        return source.scan(k) if isinstance(source, Scene) else k

    def gather(self, scans: Iterable[ScanAssociation]) -> Association:
        """Put associated scans together."""
        name = self.solver if self.kbest is None else "kbest"
        return Association(tuple(scans), name, self.all_parameters, self.seed)


def _received(solvers: tuple[registry.Own, ...], values: tuple[Any, ...]) -> Plan:
    """A plan in the process that it was sent to."""
    registry.restore(solvers)
    return Plan(*values)


def _of_problem(problem: AssignmentProblem, solution: Solution) -> ScanAssociation:
    sizes = tuple(int(n) for n in problem.sizes)
    targets, costs = _targets_of(problem, solution)
    return ScanAssociation(0, None, sizes, solution, targets, costs=costs)


def _targets_of(problem: AssignmentProblem, solution: Solution) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Tuples that are targets, and their costs."""
    number = np.count_nonzero(solution.tuples, axis=1)
    alone_but_real = (number == 1) & (problem.costs[solution.indices] < 0)
    real = (number >= 2) | alone_but_real
    return solution.tuples[real], problem.costs[solution.indices[real]]


def _without_scans(scene: Scene) -> Scene:
    """The sensors and the region of a scene."""
    empty = [[np.zeros((0, sensor.dim)) for sensor in scene.sensors]]
    return Scene(scene.sensors, scene.times[:1], empty, region=scene.region)


def _of_scan(
    scene: Scene, scan: Scan, problem: AssignmentProblem, solution: Solution, speed: float | Sequence[float]
) -> ScanAssociation:
    targets, costs = _targets_of(problem, solution)
    positions, covariances = positions_and_covariances(scene, scan, targets, speed=speed)
    truth = scan.true_tuples()
    correct = None if truth is None else len({*map(tuple, truth.tolist())} & {*map(tuple, targets.tolist())})
    return ScanAssociation(
        scan=scan.index,
        time=scan.time,
        sizes=tuple(int(n) for n in scan.sizes),
        solution=solution,
        targets=targets,
        positions=positions,
        covariances=covariances,
        costs=costs,
        true_tuples=None if truth is None else len(truth),
        correct_tuples=correct,
    )
