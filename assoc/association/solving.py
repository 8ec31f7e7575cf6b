"""Scans solved: one, `associate_scan`, or many, in other processes if wanted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

import numpy as np

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
from assoc.ranking.marginals import Marginals, marginals
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.solution import Solution
from assoc.solvers import registry
from assoc.solvers.assign import assign

GATING = ("gate_probability", "max_tuples", "speed", "target_density", "all_tuples")
"""Options of ``assoc.build_problem``."""

# most scans that are sent to a process at once
_TOGETHER = 64


@dataclass(frozen=True)
class ScanOptions:
    """How scans are associated, by the options of ``associate``; one for all processes."""

    solver: str
    seed: int = 0
    time_limit: float | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    gating: Mapping[str, Any] = field(default_factory=dict)
    """Options of ``assoc.build_problem``."""
    kbest: int | None = None
    """Rank the k best associations of each scan (``assoc.kbest``) instead of calling the solver."""
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


def _received(solvers: tuple[registry.Own, ...], values: tuple[Any, ...]) -> ScanOptions:
    """The same in the process that it was sent to."""
    registry.restore(solvers)
    return ScanOptions(*values)


def associate_scan(source: Source, scan: int | Scan, options: ScanOptions) -> ScanAssociation:
    """Associate a scan of a scene, or of its sensors; of a problem, which has no scans, the problem."""
    compiled = compile_seconds()
    seed: int | np.random.SeedSequence = options.seed
    if isinstance(source, AssignmentProblem):
        problem = source
    else:
        measured = scan if isinstance(scan, Scan) else source.scan(scan)
        problem = build_problem(source, measured, **options.gating)
        # a seed for each scan that depends on neither the process nor the scans before
        seed = np.random.SeedSequence(entropy=options.seed, spawn_key=(measured.index,))
    common: Any = {"seed": seed, "time_limit": options.time_limit, **options.parameters}
    if options.kbest is not None:
        solutions = kbest(problem, options.kbest, time_limit=options.time_limit)
    else:
        solutions = [assign(problem, options.solver, **common)]
    found = [_of_problem(problem, solution) for solution in solutions]
    if isinstance(source, Scene):
        # a position at another time than the measurements' depends on how fast targets usually fly
        found = [_placed(one, source, measured, options.gating.get("speed", SPEED)) for one in found]
    if options.marginals:
        found = _with_probabilities(found, marginals(problem, time_limit=options.time_limit))
    found = [replace(one, compile_time=compile_seconds() - compiled) for one in found]
    return found[0] if options.kbest is None else replace(found[0], ranked=tuple(found))


def all_scans(sources: Sequence[Source]) -> list[tuple[int, int]]:
    """All scans of all sources, as (source, scan)."""
    counts = [source.num_scans if isinstance(source, Scene) else 1 for source in sources]
    return [(number, k) for number, count in enumerate(counts) for k in range(count)]


def associate_scans(
    sources: Sequence[Source],
    options: ScanOptions,
    scans: Sequence[tuple[int, int]] | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
) -> Iterator[ScanAssociation]:
    """Associate scans (source, scan), by default all, in one process, in several or on a cluster; results in order."""
    if isinstance(jobs, bool) or not isinstance(jobs, (int, np.integer)) or jobs < 1:
        raise InvalidInputError(f"jobs: expected a whole number >= 1, got {jobs!r}")
    chosen = all_scans(sources) if scans is None else scans
    items: Sequence[tuple[int, int | Scan]] = chosen
    # enough batches that processes end at about the same time
    together = max(1, min(_TOGETHER, len(items) // (16 * int(jobs))))
    if jobs > 1 and scheduler is None and options.gating.get("target_density") != "auto":
        # a process is sent the scans that it solves; "auto" is found from all of them
        items = [(n, source.scan(k) if isinstance(source, Scene) else k) for n, k in chosen for source in [sources[n]]]
        sources = [_without_scans(source) if isinstance(source, Scene) else source for source in sources]
    task = partial(_associate_item, tuple(sources), options)
    return parallel_map(task, items, jobs=int(jobs), scheduler=scheduler, together=together, here=True)


def _associate_item(sources: Sequence[Source], options: ScanOptions, item: tuple[int, int | Scan]) -> ScanAssociation:
    return associate_scan(sources[item[0]], item[1], options)


def gathered(scans: Iterable[ScanAssociation], options: ScanOptions) -> Association:
    """The association that scans are together."""
    return Association(
        tuple(scans), options.solver if options.kbest is None else "kbest", options.all_parameters, options.seed
    )


def _without_scans(scene: Scene) -> Scene:
    """The sensors and the region of a scene."""
    empty = [[np.zeros((0, sensor.dim)) for sensor in scene.sensors]]
    return Scene(scene.sensors, scene.times[:1], empty, region=scene.region)


def _of_problem(problem: AssignmentProblem, solution: Solution) -> ScanAssociation:
    """The tuples that are targets, and their costs."""
    number = np.count_nonzero(solution.tuples, axis=1)
    alone_but_real = (number == 1) & (problem.costs[solution.indices] < 0)
    real = (number >= 2) | alone_but_real
    sizes, costs = tuple(int(n) for n in problem.sizes), problem.costs[solution.indices[real]]
    return ScanAssociation(0, None, sizes, solution, solution.tuples[real], costs=costs)


def _placed(found: ScanAssociation, scene: Scene, scan: Scan, speed: float | Sequence[float]) -> ScanAssociation:
    """The association of a scan, with positions, and compared with the truth."""
    positions, covariances = positions_and_covariances(scene, scan, found.targets, speed=speed)
    truth = scan.true_tuples()
    return replace(
        found,
        scan=scan.index,
        time=scan.time,
        positions=positions,
        covariances=covariances,
        true_tuples=None if truth is None else len(truth),
        correct_tuples=None
        if truth is None
        else len({*map(tuple, truth.tolist())} & {*map(tuple, found.targets.tolist())}),
    )


def _with_probabilities(scans: list[ScanAssociation], found: Marginals) -> list[ScanAssociation]:
    around = 2.0 * found.error
    values = np.clip(found.probability + np.multiply.outer([-1.0, 0.0, 1.0], around), 0.0, 1.0).T
    row = {key: number for number, key in enumerate(map(tuple, found.tuples.tolist()))}
    return [
        replace(scan, probabilities=values[[row[key] for key in map(tuple, scan.targets.tolist())]].reshape(-1, 3))
        for scan in scans
    ]
