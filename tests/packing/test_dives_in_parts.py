"""Dives that begin in a part of the solutions: one with so many triples, one with more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import assoc
from assoc.packing.branching.short_search import Part, _remainder
from assoc.packing.neighbourhoods import diving
from assoc.packing.neighbourhoods.diving import Diver, _Descent
from assoc.packing.run import Run
from assoc.packing.simplex.basis import basis_of
from assoc.packing.simplex.dual import OPTIMAL, bound_of
from assoc.packing.simplex.program import all_allowed
from assoc.simulation import simulate
from tests.packing.test_remainder import optimum
from tests.solvers.pieces import component

# what HiGHS finds (scipy.optimize.milp, mip_rel_gap=1e-9) for the problem of ``mixed``
OPTIMUM = -328.2414815625
# no cover is known
NONE = np.zeros(0, dtype=np.int64)


@pytest.fixture(scope="module")
def mixed():
    """A component whose linear program mixes solutions with different numbers of triples."""
    problem = assoc.build_problem(simulate("bearing-only", seed=12, targets=24, scans=1), 0)
    one = component(problem, "full")
    one.sharpen(Run(0))
    return one


def _best_of_dives(mixed):
    diver, rng, least = Diver(mixed, NONE, np.inf), np.random.default_rng(0), np.inf
    for number in range(30):
        owner = diver.dive(np.ones(mixed.packing.num_columns), 4.0 * 2.0 ** (number % 4), rng, least, np.inf)
        if mixed.is_complete(owner):
            least = min(least, mixed.weight_of(owner))
        # a split is judged by the best cover, and made once
        assert number >= diving._BEFORE_PARTS or not diver._parts
    return least


def test_dives_in_parts_find_what_the_others_do_not(mixed, monkeypatch):
    assert _best_of_dives(mixed) == pytest.approx(OPTIMUM, abs=1e-6)
    monkeypatch.setattr(Diver, "_split", lambda *_: [])
    assert _best_of_dives(mixed) > OPTIMUM + 0.0035 * abs(OPTIMUM)


def test_dives_begin_by_turns_in_all_solutions_and_in_a_part(mixed):
    diver = Diver(mixed, NONE, np.inf)
    # two of three parts: the third one holds nothing below so high a bound
    diver._parts = [diver._all._replace(relaxed=replace(diver._all.relaxed, bound=b)) for b in (-5.0, -4.0, -1.0)]
    diver._dives = diving._BEFORE_PARTS + 1
    starts = [diver._next_start(-2.0, np.inf) for _ in range(8)]
    assert all(start is diver._all for start in starts[::2])
    assert [start.relaxed.bound for start in starts[1::2]] == [-4.0, -5.0, -4.0, -5.0]


def test_the_program_of_a_part_is_that_of_all_with_its_ranges(mixed, monkeypatch):
    """At its mark, and while a dive fixes columns: HiGHS finds the same bound."""
    diver = Diver(mixed, NONE, np.inf)
    core, cutoff = diver._core, OPTIMUM + 3.0
    parts = diver._split(cutoff, np.inf)
    assert len(parts) > 1
    for part in parts:
        program, fixed = part.program.program, []
        everything = np.ones(program.weights.size, dtype=bool)
        assert part.relaxed.bound >= diver._all.relaxed.bound - 1e-9
        assert part.relaxed.primal.size == part.relaxed.reduced.size == core.num_columns
        assert part.relaxed.bound == pytest.approx(optimum(program, part.program.slack, everything, fixed), abs=1e-6)
        part.program.back()
        at = _Descent(core, part.program, part.relaxed, np.inf)
        for _ in range(3):
            if at.relaxed.status == OPTIMAL and at.fix(at.open_columns()[:2], 6.0, np.inf):
                fixed = at.fixed.tolist()
                least = optimum(program, part.program.slack, everything, fixed)
                assert at.relaxed.bound == pytest.approx(least, abs=1e-6)
                # and so has what is left of it, with what the fixed columns weigh
                rest = _remainder(core, part.program, Part(at._columns, core.slack & ~at._covered, at.fixed))
                alone = basis_of(rest.program, all_allowed(rest.program, rest.slack), rest.variable, rest.duals)
                assert rest.program.sides.size < program.sides.size
                assert bound_of(rest.program, alone) + core.weights[fixed].sum() == pytest.approx(least, abs=1e-6)
        assert fixed
    # nothing is split where memory is short, and nothing where counts are whole
    with monkeypatch.context() as short:
        short.setattr(diving, "memory_allows", lambda size: False)
        assert diver._split(cutoff, np.inf) == []
    whole = replace(diver._all.relaxed, primal=np.round(diver._all.relaxed.primal))
    diver._all = diver._all._replace(relaxed=whole)
    assert diver._split(cutoff, np.inf) == []


def test_a_split_takes_a_share_of_the_time(mixed, monkeypatch):
    """What is long on large programs leaves time for dives."""
    diver, seen = Diver(mixed, NONE, np.inf), []
    monkeypatch.setattr(diving, "split_on_counts", lambda *words: seen.append(words[-1]) or [])
    monkeypatch.setattr(diving, "now", lambda: 100.0)
    diver._split(0.0, 110.0)
    assert seen == [pytest.approx(103.0)]
