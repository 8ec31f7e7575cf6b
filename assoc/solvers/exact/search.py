"""The exact solver's course: reduce, improve, fix, and search the open components in turn until all are proved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

from assoc.packing.bounds.dual_ascent import PASSES, certified_bound, dual_bound, hard_pass
from assoc.packing.bounds.matched import matched
from assoc.packing.bounds.priced import TOLERANCE, Priced
from assoc.packing.branching.compiling import compile_branching_ahead
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.component import Component, split_component
from assoc.packing.cover import Cover, chosen_columns
from assoc.packing.neighbourhoods.dimensionwise import improve_dimensionwise
from assoc.packing.packing import Packing
from assoc.packing.run import Improver, Outcome, Run, infeasible
from assoc.packing.short_branching import Branching
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.packing.turns import Turns
from assoc.solvers.exact.reduction import Reduction
from assoc.solvers.exact.regions import close_by_regions
from assoc.solvers.exact.tightening import MANY

# rows from which the run's improver works from the start: below, branching closes most gaps without a good
# incumbent, and they join it only after `_ALONE` turns (about a second), for users who stop a long search
_LARGE = 150
_ALONE = 100
# share of the gap that iterations of the improver gain at least before regions and the linear program are tried, and
# how many in a row may gain less
_LITTLE, _QUIET = 0.002, 5
# turns of branching between iterations of the improver
_TURNS = 3
# columns up to which a component is branched on before anything else, and for how many nodes
_SMALL = 2000
_SHORT = 20
# columns from which a problem may be so hard that its branching should be compiled in advance
_HARD = 500
# columns per row from which it certainly is
_DENSE = 15
# columns per row up to which a component is nearly decided: branching goes first
_THIN = 4
# rows from which a component may keep the gap that the caller allows, and is improved before it is bounded
_VAST = 2000
# passes of its first bound at each temperature: nearly the whole bound, long before a second of search is over
_COARSE = 100


@dataclass(slots=True, kw_only=True)
class _Searches(Turns):
    node_limit: int
    patience: int
    gap: float = 0.0
    out_of_memory: bool = False
    with_gap: bool = False
    """Whether a component was left open because it may keep a gap."""

    @property
    def nodes_left(self) -> int:
        return self.node_limit - self.iterations

    def may_keep_gap(self, component: Component) -> bool:
        """Whether a component is so large that it gets no linear program where a gap is allowed."""
        return self.gap > 0.0 and component.packing.num_rows >= _VAST and component.best is not None

    def good_enough(self, component: Component) -> bool:
        """Whether a large component keeps its gap."""
        left = component.weight - max(component.bound, component.proven)
        enough = self.may_keep_gap(component) and left <= self.gap * abs(component.weight)
        self.with_gap |= enough and not component.closed
        return enough


@dataclass(slots=True)
class _Task:
    """A component: improved by the run's improver (`Methods`) if it is large, then branched on."""

    component: Component
    all: _Searches
    branching: Branching | None = None
    improver: Improver | None = None
    # whether regions and the linear program were tried, and iterations in a row of the improver that gained little
    bounded: bool = False
    quiet: int = 0
    # turns of branching: since the last iteration of the improver, and in all
    turns: int = 0
    age: int = 0

    def turn(self) -> bool:
        """One iteration of the improver, or some nodes of branch and bound and sometimes an iteration."""
        component = self.component
        if self.all.may_keep_gap(component):
            self.all.with_gap |= not component.closed
            return True
        if not self.all.run.should_stop() and self.all.nodes_left > 0:
            if self._improves:
                self._search_better()
                return False
            if self._awaits_bound:
                return False
            if self.branching is None:
                self.branching = Branching(component, self.all.run, BranchAndBound)
                component.stalled = 0
            # some ten milliseconds of work between two checks of the time
            if not self._branch(self.branching, max(1, 20_000 // max(component.packing.num_columns, 1))):
                self._join()
                return False
        if self.branching is not None and self.branching.search.done:
            short = self.branching.search.out_of_memory
            self.all.out_of_memory |= short
            if component.best is None and not short:
                raise infeasible(component.packing)
        return True

    def split(self) -> list[_Task]:
        """Tasks for the parts of the component: in one search the nodes of independent parts would multiply."""
        if self._awaits_bound:
            return [_Task(part, self.all, bounded=True) for part in _by_regions(self.component, self.all)]
        # branching should start with as few columns as the incumbent allows
        share = 0.9 if self.branching is None and not self._improves else 2 / 3
        parts = split_component(self.component, share) or ()
        for part in parts:
            _match(part)
        return [_Task(part, self.all, bounded=self.bounded) for part in parts]

    def branch_shortly(self) -> bool:
        """Branch at once; returns whether that closed it: small components mostly close before a better bound would."""
        component, nodes = self.component, min(_SHORT, self.all.nodes_left)
        if _match(component) or component.packing.num_columns > _SMALL or self.all.may_keep_gap(component):
            return component.closed
        if nodes <= 0 or self.all.run.should_stop():
            return component.closed
        self.branching = Branching(component, self.all.run, BranchAndBound, to_the_end=False)
        return self._branch(self.branching, nodes) or component.closed

    def _branch(self, branching: Branching, nodes: int) -> bool:
        """Search some nodes; returns whether nothing is left to search."""
        before = self.component.weight
        self.all.iterations += branching.advance(min(nodes, self.all.nodes_left))
        self.all.run.note_gain("branching", before - self.component.weight)
        return branching.search.done

    @property
    def _awaits_bound(self) -> bool:
        """Whether regions and the linear program of a large component come next."""
        return not (self.bounded or self._improves) and _is_large(self.component, self.all.run)

    @property
    def _improves(self) -> bool:
        """Whether to improve the incumbent before any branching."""
        component, patience = self.component, self.all.patience
        # small components are branched on at once, and without incumbent there is nothing to improve
        packing = component.packing
        if self.branching is not None or not _is_large(component, self.all.run):
            return False
        if not self.bounded:
            return self.quiet < _QUIET
        return packing.num_columns > _THIN * packing.num_rows and component.stalled * 60 < patience * packing.num_rows

    def _join(self) -> None:
        """Give the improver half the time while they improve the incumbent, then less and less."""
        component = self.component
        self.turns += 1
        self.age += 1
        alone = component.packing.num_rows < _LARGE and self.age < _ALONE
        if not alone and self.turns >= _TURNS * min(1 + component.stalled, 10):
            self.turns = 0
            self._search_better()

    def _search_better(self) -> None:
        """Do one iteration of the improver."""
        component, make = self.component, self.all.run.methods.improver
        if component.best is None or make is None:
            return
        if self.improver is None:
            self.improver = make(component, self.all.run)
        before = component.weight
        self.improver.iterate()
        little = before - component.weight <= _LITTLE * (component.weight - component.lower_bound)
        self.quiet = self.quiet + 1 if little else 0
        component.stalled = 0 if component.weight < before - component.tolerance else component.stalled + 1


def search_to_the_end(packing: Packing, node_limit: int, patience: int, run: Run, gap: float = 0.0) -> Outcome:
    """Solve a packing to proven optimality, large components to a gap, or until the nodes or the time are used up."""
    found = _by_matching(packing, run) if packing.num_sensors == 2 else None
    if found is not None:
        return found
    if packing.num_columns > _HARD:
        compile_branching_ahead(surely=packing.num_columns > _DENSE * packing.num_rows)
    searches = _Searches(run=run, node_limit=node_limit, patience=patience, gap=gap)
    reduction = Reduction(packing, run)
    components = reduction.reduce()
    searches.columns += reduction.closed_columns
    searches.weights.append(reduction.closed_weight)
    searches.bounds.append(reduction.closed_bound)
    tasks = [_Task(component, searches) for component in components]
    if tasks:
        # report what is known before the search of hard components, which may take long
        searches.record(tasks)
    done: list[_Task] = []
    left: list[_Task] = []
    for task in tasks:
        if task.branch_shortly():
            done.append(task)
        else:
            left.extend(
                _Task(part, searches, bounded=not _is_large(part, run))
                for part in _bound_better(task.component, searches)
            )
    tasks = done + left
    searches.record(tasks)
    searches.take(tasks)
    weight, bound = math.fsum(searches.weights), math.fsum(searches.bounds)
    cut_off = searches.out_of_memory or searches.nodes_left <= 0
    if cut_off and not run.stopped_by and bound < weight - 1e-6 * max(1.0, abs(weight)):
        run.stopped_by = "memory_limit" if searches.out_of_memory else "iterations"
    if searches.with_gap and not run.stopped_by:
        run.stopped_by = "gap"
    return searches.outcome(None if components else reduction.proof)


def _by_matching(packing: Packing, run: Run) -> Outcome | None:
    """The answer for two lists; None if rounding leaves a gap that branching may close."""
    found = matched(packing)
    if found is None:
        return None
    weight, owner, duals = found
    if weight == math.inf:
        raise infeasible(packing)
    bound = certified_bound(packing, duals)
    if weight - bound > TOLERANCE * max(1.0, abs(bound)):
        return None
    run.record(1, weight, bound)
    return Outcome(chosen_columns(packing.arrays.cols, owner), 1, bound, duals)


def _match(component: Component) -> bool:
    """Close a component whose columns join two sides; return whether it is closed."""
    if not component.closed:
        found = matched(component.packing)
        if found is not None and found[0] < math.inf:
            weight, owner, duals = found
            component.adopt_if_better(duals)
            component.offer(owner, weight)
    return component.closed


def _bound_better(component: Component, searches: _Searches) -> list[Component]:
    """Repeat the dual ascent, with enough time at every temperature, on a component that the reduction left open."""
    run = searches.run
    if run.should_stop():
        # one pass over a million columns takes longer than a short time limit
        return [component]
    if searches.may_keep_gap(component):
        # mostly enough, and far quicker than a better bound
        cover = Cover.of(component.packing, component.best_columns())
        improve_dimensionwise(component.packing, cover.owner, run.deadline())
        component.offer(cover.owner, cover.weight)
        if searches.good_enough(component):
            return [component]
    # a large one first gets a better cover, in turns: that leaves so few columns that the rest is quick
    deferred = _is_large(component, run) and not searches.may_keep_gap(component)
    if deferred and component.packing.num_rows >= _VAST and run.methods.improver is not None:
        # the bound takes longer than the first iteration, which gains most
        run.methods.improver(component, run).iterate()
    component.adopt_if_better(dual_bound(component.packing, passes=_COARSE if deferred else PASSES, run=run))
    return [component] if deferred else _by_regions(component, searches)


def _is_large(component: Component, run: Run) -> bool:
    """Whether a component has a cover that is worth improving before anything else."""
    return component.packing.num_rows >= _LARGE and component.best is not None and run.methods.improver is not None


def _by_regions(component: Component, searches: _Searches) -> list[Component]:
    """Search the places that cause a large component's gap; the components that are left."""
    if component.closed or searches.run.should_stop():
        return [component]
    useful = None
    if component.packing.num_rows >= _LARGE and component.best is not None and not component.packing.is_axial:
        before = component.weight
        useful = close_by_regions(component, partial(_search_shortly, searches), searches.run)
        searches.run.note_gain("regions", before - component.weight)
    parts = (None if component.closed else split_component(component, useful=useful)) or [component]
    return [smaller for part in parts for smaller in _with_program(part, searches)]


def _search_shortly(searches: _Searches, packing: Packing) -> Outcome:
    """Search a packing of small components, each for a moment."""
    run, nodes = searches.run, min(_SHORT * packing.num_components, searches.nodes_left)
    found = search_to_the_end(packing, nodes, 0, run.part(run.rng, run.time_limit), searches.gap)
    searches.iterations += found.iterations
    return found


def _with_program(component: Component, searches: _Searches) -> list[Component]:
    """Adopt the multipliers of the linear program; the components that are left, or the component itself."""
    # cuts have shown more than the linear program can
    tight = component.packing.num_rows >= MANY and component.proven > component.bound
    if searches.may_keep_gap(component) or tight:
        return [component]
    if not component.closed and not searches.run.should_stop():
        bound_by_linear_program(component, searches.run)
    return (None if component.closed else split_component(component, share=0.9)) or [component]


def bound_by_linear_program(priced: Priced, run: Run) -> None:
    """Adopt the multipliers of the linear program, if there is memory to solve it."""
    packing = priced.packing
    if not run.memory_allows(LinearProgram.memory(packing)):
        return
    duals = LinearProgram(packing).solve(duals=priced.duals, deadline=run.deadline()).duals
    hard_pass(packing, duals)
    priced.adopt_if_better(duals)
