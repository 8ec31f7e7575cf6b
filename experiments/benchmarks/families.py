"""Which instances are run, by whom, for how long."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from experiments.common.contestants import HEURISTICS, ONE_CORE, OURS
from experiments.common.instances import FIRST_SEED, scenes, synthetic

WIDE_GAPS = {20: (2001, 2018, 2022, 2033, 2037), 40: (2014, 2037, 2041, 2068, 2089)}
"""Targets -> the first five seeds of ghosts from 2000 on whose linear program is about 1 % (0.7 % or more) below the
optimum, as a tabu search of 5 s knows it: the column ``extra`` of the rows."""


def _seeds(count: int) -> range:
    return range(FIRST_SEED, FIRST_SEED + count)


@dataclass(frozen=True)
class Instance:
    """A problem and, where the construction gives it, its optimum."""

    problem: AssignmentProblem
    optimum: float | None = None


@dataclass(frozen=True)
class Entry:
    """One solver in a case.

    solver: Name in `experiments.common.contestants`.
    limit: Time limit, seconds.
    stop_gap: Stop as soon as the relative gap is this small (our solvers only).
    """

    solver: str
    limit: float
    stop_gap: float | None = None

    @property
    def label(self) -> str:
        """The name under which it is reported."""
        return self.solver if self.stop_gap is None else f"{self.solver}@{100 * self.stop_gap:g}%"

    @property
    def peer(self) -> bool:
        """Whether it is somebody else's."""
        return self.solver not in OURS


@dataclass(frozen=True)
class Case:
    """One size of a family: how to make its instances, and who runs on them, peers first.

    ``brief`` is the number of seeds of a whole run in little time.
    """

    family: str
    size: str
    make: Callable[[int], Iterator[Instance]]
    entries: tuple[Entry, ...]
    seeds: Sequence[int] = _seeds(5)
    brief: int = 2

    def changed(self, change: Callable[[Entry], Entry | None]) -> Self:
        """Return the same case with each entry changed, or left out where there is none then; equal ones once."""
        changed = [entry for entry in map(change, self.entries) if entry is not None]
        return replace(self, entries=tuple(dict.fromkeys(changed)))

    def by_seed(self, most: int | None = None) -> list[Self]:
        """Return a case for each seed, of so many at the most."""
        return [replace(self, seeds=(seed,)) for seed in self.seeds[:most]]


def on_one_core(entry: Entry) -> Entry:
    """The same solver, on one core."""
    return replace(entry, solver=ONE_CORE.get(entry.solver, entry.solver))


def _scans(make: Callable[..., Scene], *size: int) -> Callable[[int], Iterator[Instance]]:
    """What makes an instance of each scan of a scene, from the seed, which the scene is given last."""
    return lambda seed: (
        Instance(build_problem(scene, scan)) for scene in [make(*size, seed)] for scan in range(scene.num_scans)
    )


def _one(make: Callable[..., Any], *size: int) -> Callable[[int], Iterator[Instance]]:
    """What makes the one instance of a problem, or of a problem and its optimum, from the seed."""
    return lambda seed: (Instance(*(found if isinstance(found, tuple) else (found,))) for found in [make(*size, seed)])


def _entries(names: tuple[str, ...], limit: float) -> tuple[Entry, ...]:
    return tuple(Entry(name, limit) for name in names)


def cases() -> list[Case]:
    """Return all cases, in the order of the report."""
    return [
        *_paper_cases(),
        *_gated_cases(),
        *_ghost_cases(),
        *_wide_gap_cases(),
        *_wide_gate_cases(),
        *_synthetic_cases(),
    ]


def _paper_cases() -> Iterator[Case]:
    ours = _entries(("exact", "lagrangian", *HEURISTICS, "greedy", "milp"), 1.0)
    peers = _entries(("highs", "sequential"), 10.0)
    yield Case("paper", "3 radars", _scans(scenes.three_radar), peers + ours)


def _gated_cases() -> Iterator[Case]:
    peers = _entries(("cp_sat", "highs", "scip", "scip_1", "sequential"), 60.0)
    for sensors, targets, limit in ((3, 100, 1.0), (3, 300, 1.0), (3, 1000, 3.0), (4, 300, 3.0), (5, 200, 3.0)):
        ours = (
            Entry("exact", 60.0),
            Entry("lagrangian", 10.0, stop_gap=1e-3),
            Entry("lagrangian", 10.0),
            *_entries(HEURISTICS, limit),
            Entry("greedy", 10.0),
        )
        yield Case("gated", f"{sensors}x{targets}", _scans(scenes.gated, sensors, targets), peers + ours)


def _ghost_cases() -> Iterator[Case]:
    # Limits beside each other: what a peer has after as long as our heuristics get, and much later.
    plan: tuple[tuple[int, tuple[float, ...], float, int], ...] = (
        (20, (60.0,), 60.0, 10),
        (40, (5.0, 60.0), 60.0, 10),
        (60, (5.0, 60.0), 60.0, 5),
        (100, (5.0, 60.0), 30.0, 5),
    )
    for targets, limits, own, seeds in plan:
        ours = (Entry("exact", own), Entry("lagrangian", 5.0), *_entries(HEURISTICS, 5.0), Entry("greedy", 5.0))
        # it ends by itself, when it is cold
        ours += (Entry("annealing", 60.0),) if targets <= 40 else ()
        names = ("cp_sat", "highs", "scip", *(("scip_1",) if targets == 20 else ()))
        peers = [Entry(name, limit) for name in names for limit in limits]
        peers.append(Entry("sequential", 5.0))
        # codes for independent sets, two of them where their graph is not too large; none gives a proof, and that
        # is the question at 20 targets
        late = 10.0 if targets == 20 else 60.0
        peers += [Entry("chils", limit) for limit in sorted({min(limits[0], late), late})]
        peers += _entries(("branch_reduce", "mmwis"), late) if targets <= 40 else ()
        brief = {20: 10, 40: 5}.get(targets, 2)
        yield Case("ghost", str(targets), _scans(scenes.ghost, targets), (*peers, *ours), _seeds(seeds), brief)


def _wide_gap_cases() -> Iterator[Case]:
    ours, peers = _entries(("exact",), 60.0), _entries(("cp_sat", "highs", "scip", "scip_1"), 60.0)
    for targets, seeds in WIDE_GAPS.items():
        brief = 5 if targets == 20 else 2
        yield Case("wide gap", str(targets), _scans(scenes.ghost, targets), peers + ours, seeds, brief)


def _wide_gate_cases() -> Iterator[Case]:
    ours = (Entry("exact", 60.0), Entry("lagrangian", 10.0, stop_gap=1e-3), Entry("greedy", 10.0))
    peers = _entries(("highs", "scip_1"), 120.0)
    for targets in (1000, 2000, 3000):
        yield Case("wide gates", str(targets), _one(synthetic.wide_gates, targets), peers + ours, brief=1)


def _synthetic_cases() -> Iterator[Case]:
    for n, limit, seeds in ((10, 5.0, 10), (20, 5.0, 10), (30, 5.0, 10), (50, 10.0, 5), (100, 10.0, 3)):
        ours = (Entry("exact", 20.0), *_entries((*HEURISTICS, "lagrangian", "greedy"), limit))
        peers = (Entry("highs", 30.0), Entry("scip_1", 30.0), Entry("cp_sat", 10.0))
        peers += _entries(("sequential",), limit)
        if n == 100:
            # a million tuples, which no other solver takes
            ours, peers = ours[:1], _entries(("sequential",), limit)
        yield Case("known optimum", f"n={n}", _one(synthetic.axial_known_optimum, n), peers + ours, _seeds(seeds))
    limits = {12: 5.0, 20: 10.0, 26: 10.0}
    # 60 instances of the sizes of Balas and Saltzman, heuristics on three sizes
    for n in range(4, 27, 2):
        ours, peers = _entries(("exact",), 60.0), _entries(("highs", "scip_1"), 60.0)
        if n in limits:
            ours += _entries((*HEURISTICS, "lagrangian", "greedy"), limits[n])
            peers += (Entry("cp_sat", 30.0), Entry("sequential", limits[n]))
        yield Case("random axial", f"n={n}", _one(synthetic.axial_random, n), peers + ours)
    ours = _entries(("exact", "lagrangian", *HEURISTICS, "milp", "greedy"), 5.0)
    peers = _entries(("highs", "cp_sat", "sequential"), 30.0)
    for sensors in (3, 4, 5, 6):
        yield Case("planted", f"S={sensors}", _one(synthetic.planted, sensors), peers + ours)
