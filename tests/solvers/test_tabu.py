"""Tabu search against a plain one, move by move, same random numbers."""

import numpy as np
import pytest

from assoc._system.compiled import draws
from assoc.packing.neighbourhoods.insertion import search_arrays
from assoc.solvers.tabu.moves import TabuSearch, _moves
from assoc.solvers.tabu.parameters import TabuParameters
from tests.solvers.pieces import (
    Incumbent,
    columns_of,
    component,
    cover_of,
    is_complete,
    iterate,
    problems,
    rows_of,
    search_of,
    temperature,
    with_greedy_cover,
)

PROBLEMS = problems()


class Reference:
    """A cover as a list of columns, moved by the best insertion that is not tabu."""

    def __init__(self, one, columns, until, clock=1):
        self.packing, self.weights = one.packing, search_arrays(one.packing).weights
        self.rows = [rows_of(self.packing, j) for j in range(self.packing.num_columns)]
        self.columns, self.until, self.clock = list(columns), until, clock

    def ejected(self, j):
        """Columns that stand in the way of j, in the order of its rows."""
        owner = {r: k for k in self.columns for r in self.rows[k]}
        return list(dict.fromkeys(owner[r] for r in self.rows[j] if r in owner))

    def gain(self, j):
        """What inserting j adds to the weight."""
        change = self.weights[j]
        for k in self.ejected(j):
            change -= self.weights[k]
        return change

    def run(self, moves, tenure, forced, rng):
        """Move; returns the best columns met."""
        best, current, record = list(self.columns), 0.0, 0.0
        for move in range(moves):
            self.clock += 1
            held = forced if 3 * move < moves else -1
            if move == 0 and forced >= 0:
                chosen = forced
            else:
                allowed = [j for j in range(len(self.weights)) if j not in self.columns]
                if held in self.columns:
                    allowed = [j for j in allowed if not {*self.rows[j]} & {*self.rows[held]}]
                gains = {j: self.gain(j) for j in allowed}
                # tabu, unless that leads below the best (aspiration)
                open_now = [j for j in allowed if self.until[j] < self.clock or current + gains[j] < record - 1e-9]
                chosen = min(open_now, key=lambda j: (gains[j], j), default=-1)
                if chosen < 0:
                    chosen = int(rng.integers(0, len(self.weights)))
                    if chosen in self.columns or chosen == held:
                        continue
            current += self.gain(chosen)
            out = self.ejected(chosen)
            for k in out:
                self.until[k] = self.clock + tenure + rng.integers(0, tenure + 1)
            left = [r for k in out if k != chosen for r in self.rows[k]]
            self.columns = [k for k in self.columns if k not in out and k != chosen] + [chosen]
            for r in left:
                if any(r in self.rows[k] for k in self.columns):
                    continue
                taken = {q for k in self.columns for q in self.rows[k]}
                free = [
                    j
                    for j in range(len(self.weights))
                    if r in self.rows[j]
                    and self.weights[j] < -1e-12
                    and self.until[j] < self.clock
                    and not taken & {*self.rows[j]}
                ]
                if free:
                    fill = min(free, key=lambda j: (self.weights[j], j))
                    current += self.weights[fill]
                    self.columns.append(fill)
            if current < record - 1e-9:
                record, best = current, list(self.columns)
        return sorted(best)


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("tenure", [0, 3, 30])
def test_move_by_move(name, tenure):
    """From greedy covers, with and without a column that is forced in, until all is tabu."""
    one = with_greedy_cover(component(PROBLEMS[name]))
    for seed in range(4):
        forced = -1
        if seed % 2:
            outside = np.setdiff1d(np.arange(one.packing.num_columns), columns_of(one.best))
            forced = int(outside[seed % outside.size])
        until = np.zeros(one.packing.num_columns, dtype=np.int64)
        expected = Reference(one, columns_of(one.best), until.copy())
        owner, best = one.best.copy(), one.best.copy()
        rules = (1, 60, tenure, forced)
        clock = _moves(
            search_arrays(one.packing), owner, best, until, rules, draws(np.random.default_rng(seed)), np.inf
        )
        found = expected.run(60, tenure, forced, np.random.default_rng(seed))
        assert columns_of(owner) == sorted(expected.columns)
        np.testing.assert_array_equal(owner, cover_of(one.packing, expected.columns))
        assert columns_of(best) == found
        np.testing.assert_array_equal(until, expected.until)
        assert clock == expected.clock


class ReferenceSearch(Incumbent):
    """Moves, and what happens between them: restarts from the best, forced columns, new covers."""

    def __init__(self, one, parameters, rng):
        super().__init__(one, parameters, rng)
        self.until = np.zeros(one.packing.num_columns, dtype=np.int64)
        self.columns, self.clock, self.restarts = None, 1, 0

    def afresh(self):
        """Best of twelve random greedy covers."""
        start, least = self.best, np.inf
        for number in range(12):
            columns, cost = self.random_cover(2.0 ** (number % 6))
            if cost < least and is_complete(self.one.packing, columns):
                start, least = columns, cost
        return [] if start is None else start

    def force(self):
        """Draw a row by its excess over the bound, and another column there by its reduced cost."""
        packing, scale = self.one.packing, temperature(self.one, self.least)
        owner = cover_of(packing, self.columns)
        excess = np.array([-self.one.duals[r] if j < 0 else self.one.reduced[j] for r, j in enumerate(owner)])
        excess = np.maximum(excess + 1e-3 * scale, 0.0)
        row = int(self.rng.choice(packing.num_rows, p=excess / excess.sum()))
        others = [j for j in range(packing.num_columns) if row in rows_of(packing, j) and j != owner[row]]
        if not others:
            return -1
        reduced = self.one.reduced[others]
        chances = np.exp(-(reduced - reduced.min()) / scale)
        return int(self.rng.choice(others, p=chances / chances.sum()))

    def iterate(self):
        """One iteration."""
        before = self.least
        forced = -1
        if self.columns is None:
            self.columns = self.afresh()
        elif self.best is not None and self.stalled and self.stalled % self.p.restart == 0:
            self.restarts += 1
            self.until[:] = 0
            if self.restarts % 3 == 0:
                self.columns = self.afresh()
            else:
                self.columns = self.best
                forced = self.force()
        moves = Reference(self.one, self.columns, self.until, self.clock)
        found = moves.run(self.p.moves, self.p.tenure, forced, self.rng)
        self.columns, self.clock = moves.columns, moves.clock
        self.offer(found)
        self.ends_iteration(before)


@pytest.mark.parametrize("name", PROBLEMS)
def test_iteration_by_iteration(name):
    one = component(PROBLEMS[name])
    parameters = TabuParameters(tenure=4, moves=8, restart=2, refinement="none")
    search, local = TabuSearch(one, parameters), search_of(one, 5)
    expected = ReferenceSearch(one, parameters, np.random.default_rng(5))
    for _ in range(16):
        expected.iterate()
        assert iterate(one, search, local) == expected.best
        assert columns_of(search.owner) == sorted(expected.columns)
        np.testing.assert_array_equal(search.until, expected.until)
        assert (search.clock, search.restarts) == (expected.clock, expected.restarts)
    assert search.restarts >= 3, "a restart from a new cover was not seen"
