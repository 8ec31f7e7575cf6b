"""A solver of one's own: registered once, it is one of them; its answers are checked and certified."""

from dataclasses import dataclass, field

import numpy as np
import pytest

import assoc
from assoc.errors import InfeasibleError, InvalidInputError
from assoc.solvers import Outcome, Parameters


@dataclass(frozen=True)
class LastParameters(Parameters):
    skip: int = field(default=0, metadata={"help": "columns to leave out"})

    def __post_init__(self) -> None:
        self._require(self.skip >= 0, "skip", "a whole number of at least 0")


def last_first(packing, parameters, run):
    """Columns from the last to the first, each taken if it still fits."""
    chosen, used = [], set()
    for column in range(packing.num_columns - 1 - parameters.skip, -1, -1):
        rows = {int(r) for r in packing.cols[column] if r >= 0}
        if not rows & used:
            chosen.append(column)
            used |= rows
    return Outcome(np.array(chosen, dtype=np.int64), 1)


@pytest.fixture
def registered():
    assoc.solvers.register("last", LastParameters, last_first)


PROBLEM = assoc.AssignmentProblem([[1, 1], [2, 2], [1, 2], [2, 1]], [-3.0, -2.0, -4.0, -0.5], [2, 2])


def test_it_is_called_by_name_checked_and_bounded(registered):
    assert assoc.solvers.names()[-1] == "last"
    solution = assoc.assign(PROBLEM, "last")
    assert sum(solution.tuples[:, 0]) == 3  # both measurements of the first sensor, each once
    assert -5.0 - 1e-9 <= solution.lower_bound <= solution.cost
    assert solution.solver == "last" and solution.parameters == {"skip": 0}
    nothing = assoc.assign(PROBLEM, "last", skip=4)
    assert nothing.cost == 0.0 and len(nothing.tuples) == 4


def test_wrong_parameters_and_taken_names_are_refused(registered):
    with pytest.raises(InvalidInputError, match="skip: expected a whole number"):
        assoc.assign(PROBLEM, "last", skip=-1)
    with pytest.raises(InvalidInputError, match="skpi: no parameter of solver 'last'; did you mean skip"):
        assoc.assign(PROBLEM, "last", skpi=1)
    for name in ("last", "exact"):
        with pytest.raises(InvalidInputError, match=f"the name '{name}' is taken"):
            assoc.solvers.register(name, LastParameters, last_first)


def test_an_infeasible_answer_is_caught(registered):
    def everything(packing, parameters, run):
        return Outcome(np.arange(packing.num_columns), 1)

    assoc.solvers.register("all", LastParameters, everything)
    with pytest.raises(InfeasibleError, match="does not use every measurement exactly once"):
        assoc.assign(PROBLEM, "all")


def test_its_packing_is_a_copy_that_cannot_be_written(registered):
    """What it does to its packing changes no answer, its own or a later one."""
    problem = assoc.AssignmentProblem(PROBLEM.tuples, PROBLEM.costs, PROBLEM.sizes)

    def spoil(packing, parameters, run):
        for array in packing.arrays:
            array[:] = 0
        for one in (packing, packing.component(0)):
            assert all(array.flags.writeable for array in one.arrays)  # read-only ones would be compiled for anew
        with pytest.raises(ValueError, match="read-only"):
            packing.weights[:] = -packing.weights
        for name in ("cols", "weights", "slack", "origin", "row_origin", "row_ptr", "row_cols"):
            array = getattr(packing, name)
            array.flags.writeable = True
            array[:] = 0
        return Outcome([], 1)

    assoc.solvers.register("spoil", LastParameters, spoil)
    assert assoc.assign(problem, "spoil").lower_bound == pytest.approx(-5.0)
    assert assoc.assign(problem, "exact").cost == -5.0


@pytest.mark.parametrize(
    "duals, bound",
    [(None, -5.0), ([-4.0, -2.0, 0.0, 0.0], -6.0), ([9e307] * 4, -6.0), ([0.0, 0.0, -4.0, 1e9], -6.0)],
)
@pytest.mark.parametrize("claimed", [np.inf, -1.0, np.nan, "text"])
def test_its_bound_is_that_of_its_multipliers(registered, claimed, duals, bound):
    assoc.solvers.register("liar", LastParameters, lambda packing, parameters, run: Outcome([], 1, claimed, duals))
    solution = assoc.assign(PROBLEM, "liar")
    assert solution.lower_bound == pytest.approx(bound) and solution.status == "feasible"


@pytest.mark.parametrize(
    "outcome, message",
    [
        (lambda: None, "it to return an Outcome, got NoneType"),
        *((lambda one=one: Outcome(one, 1), "the columns of its Outcome to be a list of whole numbers")
          for one in ([0.5], ["a"], [[1], [2, 3]], [[0]], {1}, None, [2**64])),
        *((lambda one=one: Outcome([0, one], 1), f"among the packing's 4, got {one}") for one in (-1, 4, 2**62)),
        (lambda: Outcome(np.array([2**63], dtype=np.uint64), 1), f"among the packing's 4, got {2**63}"),
        *((lambda one=one: Outcome([], one), "the iterations of its Outcome to be a whole number")
          for one in ("a", -1, 1.5, None)),
        *((lambda one=one: Outcome([], 1, duals=one), "the duals of its Outcome to be 4 numbers, one for each row")
          for one in ([0.0], ["a"] * 4, [np.nan] * 4, [[0.0] * 4], [1j] * 4, "abc")),
    ],
)  # fmt: skip
@pytest.mark.parametrize("start", [None, "greedy"])
def test_what_is_no_outcome_is_one_line(registered, start, outcome, message):
    assoc.solvers.register("wrong", LastParameters, lambda packing, parameters, run: outcome())
    with pytest.raises(InvalidInputError, match=f"solver 'wrong': expected .*{message}") as caught:
        assoc.assign(PROBLEM, "wrong", start=start and assoc.assign(PROBLEM, start))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "solver, name, values",
    [
        *((solver, "refinement", ("some", 1, None)) for solver in ("aco", "genetic", "tabu")),
        *((solver, "workers", (0, -1, 1001, 1.5, True)) for solver in ("aco", "genetic", "tabu")),
        *((solver, "clusters", (0, 10**20, 2.5)) for solver in ("aco", "genetic", "tabu")),
        ("aco", "divers", (-1, 10**20, "two")),
        ("genetic", "population", (1, 10**20)),
        ("genetic", "tournament", (0, 21)),
        ("tabu", "tenure", (-1, 10**20)),
        ("tabu", "moves", (0, 10**20)),
    ],
)
def test_parameters_of_metaheuristics_out_of_range(solver, name, values):
    """One line, before anything is searched: kernels know whole numbers of 64 bits."""
    problem = assoc.AssignmentProblem([[1, 1]], [-1.0], [1, 1])
    for value in values:
        with pytest.raises(assoc.InvalidInputError, match=f"{name}: expected"):
            assoc.assign(problem, solver, **{name: value})
