"""Memory is estimated before it is taken: guards refuse in time, estimates are right, searches stay within."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from assoc._system import memory
from assoc.costs.build import build_problem
from assoc.errors import LimitExceededError
from assoc.filters.state import Gaussian
from assoc.metrics.ospa import ospa
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.prepare import prepare
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.simulation import simulate, simulate_recording
from assoc.simulation.dubins.paths import Pose, shortest
from assoc.solvers.assign import assign
from assoc.tracking.filter_choice import make_filter
from tests.oracles import gated_problem
from tests.reliability.big import axial, ghosts
from tests.reliability.memory import peak_of
from tests.running import process
from tests.sizes import sample

linux = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="asks Linux how much memory there is")


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Let there be so many bytes of memory, of which also small amounts are asked for."""

    def let(count: float) -> None:
        monkeypatch.setattr(memory, "_SMALL", 0)
        monkeypatch.setattr(memory, "available", lambda here=True: count)

    return let


# --- how much there is ------------------------------------------------------------------------------------------


@linux
def test_an_address_space_limit_counts() -> None:
    """A child with 2 GB of address space has less than that, and refuses 1.9 GB before it takes them."""
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))\n"
        "from assoc._system import memory\n"
        "assert 0 < memory.available() < 2 << 30 < memory.available(here=False)\n"
        "memory.require(1 << 28, 'small', '')\n"
        "memory.require(1.95e9, 'tuples = 3', 'take fewer')\n"
    )
    last = process("-c", code).stderr.strip().splitlines()[-1]
    assert re.search(r"LimitExceededError: tuples = 3 would take about 1\.95 GB of memory, .* available; take f", last)


# --- refusals ---------------------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "false alarms": (lambda: simulate("three-radar", scans=1, false_alarms=1e14), "lower false_alarms"),
    "crowd": (lambda: simulate("crowd", targets=10**7, scans=10**7), "lower targets|lower scans"),
    "crowd of false alarms": (lambda: simulate("crowd", false_alarms_per_target=1e12), "false_alarms_per_target"),
    "UAV": (lambda: simulate("dubins-uav", interval=1e-12, obstacles=0), "lower 1/interval"),
    "path": (lambda: shortest(Pose(0, 0, 0), Pose(9, 9, 0), 1.0).sample(1.0, 1e-14), "lengthen the interval"),
    "false plots": (lambda: simulate_recording("rotating-radar", false_plots=1e15), "false_plots = 1e\\+15"),
    "tuples": (
        lambda: AssignmentProblem(np.broadcast_to(np.int32(1), (10**12, 3)), np.broadcast_to(0.0, 10**12), [1] * 3),
        "split the problem",
    ),
    "distances": (lambda: ospa(np.zeros((10**7, 1)), np.ones((10**7, 1)), 1.0), "fewer points"),
}


@linux
@sample("case", REFUSED, every=4)
def test_refused_before_memory_is_taken(case: str) -> None:
    """What no machine has room for is refused, by one line, and nothing is taken for it."""
    work, advice = REFUSED[case]

    def refused() -> str:
        with pytest.raises(LimitExceededError) as caught:
            work()
        return str(caught.value)

    refused()  # loads modules and kernels
    message, peak = peak_of(refused)
    assert re.search(advice, message) and "would take about" in message and "\n" not in message
    # ospa copies and checks its points first
    assert peak < (400e6 if case == "distances" else 60e6)


@pytest.mark.parametrize(
    ("solver", "parameters", "says"),
    [
        ("aco", {"mode": "paper", "ants": 100_000}, r"ants = 100000 on \d+ measurements"),
        ("genetic", {"population": 100_000}, r"population = 100000 on \d+ measurements"),
        ("milp", {"backend": "highs", "time_limit": 1.0}, r"backend highs on \d+ tuples"),
    ],
)  # fmt: skip
def test_solvers_refuse_what_their_arguments_cost(
    solver: str, parameters: dict[str, Any], says: str, little: Callable[[float], None]
) -> None:
    problem = ghosts(30, 3000)
    little(5e6)
    with pytest.raises(LimitExceededError, match=says):
        assign(problem, solver, **parameters)


def test_processes_are_counted(little: Callable[[float], None]) -> None:
    from assoc._system.processes import process_map

    little(1e9)
    with pytest.raises(LimitExceededError, match="jobs: 300 processes would take about 30 GB"):
        list(process_map(abs, range(300), 10**6))


def test_ensembles_are_refused_before_they_are_drawn(little: Callable[[float], None]) -> None:
    """A step of thousands of tuples by ensembles, not only their start: it ended in a MemoryError of numpy."""
    sensor = simulate("three-radar", scans=1).sensors[0]
    filter = make_filter("enkf", [sensor])
    few = filter.start(Gaussian(np.tile([3e4, 3e4, 5e3, 1.0, 1.0, 1.0], (50, 1)), np.tile(1e4 * np.eye(6), (50, 1, 1))))
    measured = sensor.measure(few.mean[:, :3])
    little(2e5)
    for work in (lambda: filter.update(few, measured, sensor), lambda: filter.predict(few, 1.0)):
        with pytest.raises(
            LimitExceededError, match=r"size = 100: 50 ensembles would take about .*; take fewer members"
        ):
            work()


def test_thousands_of_sensors() -> None:
    """Gates of pairs of sensors take a square of their number, not a cube."""
    scene = simulate("crowd", targets=2, sensors=400)
    seen = [z[:1] if s < 2 else z[:0] for s, z in enumerate(scene.measurements[0])]
    _, peak = peak_of(lambda: build_problem(type(scene)(scene.sensors, scene.times, [seen]), 0))
    assert peak < 100e6


# --- searches go on in the memory that there is -----------------------------------------------------------------


def test_branch_and_bound_gives_nodes_up(little: Callable[[float], None]) -> None:
    """Without memory for more nodes the search ends with a valid bound, and does not say that it has proved more."""
    problem = axial(14, seed=1)
    packing = prepare(problem).packing
    search = BranchAndBound(packing, dual_bound(packing), math.inf, 1e-9)
    arrays = search._open.arrays
    search._open.arrays = arrays._replace(first=arrays.first[:3])  # so that it would soon have to grow
    optimum = assign(problem, "exact").cost
    little(0.0)
    while not search.done:
        search.run(100)
    assert search.out_of_memory and search._open.arrays.first.size == 3
    assert search.lower_bound <= optimum + 1e-9 and search.weight >= optimum - 1e-9


@pytest.mark.parametrize("count", [0.0, 300e3])
def test_exact_says_that_memory_ended_it(little: Callable[[float], None], count: float) -> None:
    problem = axial(14, seed=1)
    optimum = assign(problem, "exact")
    little(count)
    short = assign(problem, "exact")
    assert optimum.status == "optimal"
    assert short.stopped_by == "memory_limit" and short.status == "feasible"
    assert short.lower_bound <= optimum.cost <= short.cost


@pytest.mark.parametrize("shape", [(6, 6), (4, 4, 4)])
def test_kbest_returns_what_there_is_memory_for(shape: tuple[int, ...], little: Callable[[float], None]) -> None:
    """The ranks that fit, as they are in the longer list, and what is said of the rest holds."""
    problem = gated_problem(np.random.default_rng(1), shape, 0.8)
    all_of_them = kbest(problem, 200)
    little(100e3)
    few = kbest(problem, 10**30)
    assert 1 < len(few) < 100 and few[0].stopped_by == "memory_limit"
    np.testing.assert_allclose([one.cost for one in few], [one.cost for one in all_of_them[: len(few)]])
    assert few[-1].lower_bound <= all_of_them[len(few)].cost + 1e-9


def test_a_trace_stays_short() -> None:
    run, steps = Run(0), 250_000
    for step in range(steps):
        run.record(step, -float(step), -1e6)
    iterations = [point.iteration for point in run.trace]
    assert 50_000 <= len(iterations) <= 100_000 and iterations == sorted(iterations)
    assert iterations[0] == 0 and iterations[-1] == steps - 1


# --- estimates are of the right size ----------------------------------------------------------------------------


@linux
@sample(
    "name, parameters",
    [
        ("three-radar", {"scans": 1500}),
        ("three-radar", {"scans": 3, "false_alarms": 200_000.0}),
        ("crowd", {"targets": 100_000}),
        ("dubins-uav", {"interval": 0.05, "obstacles": 0}),
        ("rotating-radar", {"aircraft": 1, "false_plots": 2000.0}),
    ],
    every=5,
)
def test_estimates_of_scenes(name: str, parameters: dict[str, Any], little: Callable[[float], None]) -> None:
    """The least memory with which it is not refused is what it takes, or up to five times that."""
    make: Callable[..., Any] = simulate_recording if name == "rotating-radar" else simulate
    make(name)
    asked, peak = 0.0, None
    while peak is None:
        little(asked)
        try:
            _, peak = peak_of(lambda: make(name, **parameters))
        except LimitExceededError as error:
            asked = 1.01 * bytes_in(str(error)) + 1e6
    assert peak < 1.2 * asked + 5e6
    assert asked < 6.0 * peak + 20e6


def bytes_in(message: str) -> float:
    """What a refused amount of memory is, by its message."""
    number, unit = re.search(r"would take about (\S+) ([MG])B", message).groups()  # type: ignore[union-attr]
    return float(number) * {"M": 1e6, "G": 1e9}[unit]


PER_TUPLE = {
    "greedy": 100, "exact": 1100, "aco": 1100, "aco paper": 250, "genetic": 1100, "tabu": 1100, "lagrangian": 300,
    "kbest": 300, "marginals": 600,
}  # fmt: skip
"""Bytes for each tuple of three sensors, beside the problem, as docs/reliability.md says: most of 1100 are the linear
program's, which is solved up to 200,000 tuples. 20 MB are for what is fixed."""


@linux
@sample("way", PER_TUPLE, every=4)
def test_solvers_take_what_is_said(way: str) -> None:
    from tests.reliability.limits import WAYS

    WAYS[way](ghosts(30, 3000), 0.2)
    problem = ghosts(80, 100_000)
    _, peak = peak_of(lambda: WAYS[way](problem, 0.5))
    assert peak < PER_TUPLE[way] * problem.num_tuples + 20e6
