"""Compile branch and bound ahead of time for hard problems, most of it in another process."""

from __future__ import annotations

import numpy as np

from assoc._system.compiled import compile_ahead, compile_for
from assoc._system.interpreted import interpreted_only
from assoc.packing.branching.depth_first import search_depth_first
from assoc.packing.branching.node import new_work
from assoc.packing.branching.pairs import decide
from assoc.packing.branching.root import plain_root
from assoc.packing.branching.search import BranchAndBound
from assoc.packing.packing import Packing, assemble
from assoc.packing.simplex.dual import Effort


def compile_branching_ahead(*, surely: bool) -> None:
    """Compile the search in another process, unless it is compiled already.

    If ``surely``, this process compiles the trials of pairs meanwhile: the other process takes longer than this one
    needs before its first search, and finds the trials in the cache.
    """
    if compile_ahead(search_depth_first, compile_branching) and surely:
        _compile_trials()


def compile_all_branching_ahead() -> None:
    """Compile in another process also what searches to the end need, and even where kernels are not interpreted."""
    compile_ahead(search_depth_first, compile_all_branching, anyway=True)


def compile_branching() -> None:
    """Compile the search, on three measurements any two of which could be one target."""
    _on_three(to_the_end=False)


def compile_all_branching() -> None:
    """Compile the search and the cuts of its root: the three measurements are an odd set with a violated cut."""
    compile_branching()
    _on_three(to_the_end=True)


def _compile_trials() -> None:
    packing = _three()
    root = plain_root(packing, np.zeros(packing.num_rows))
    work = new_work(packing.arrays, root.program, root.slack)
    arguments = (work.program, work.cols, work.node, work.basis, work.trials, 1, Effort(0.0, 0, np.inf))
    compile_for(decide, *arguments)


def _on_three(to_the_end: bool) -> None:
    packing = _three()
    BranchAndBound(packing, np.zeros(packing.num_rows), np.inf, 1e-9, to_the_end=to_the_end).run(10)


def _three() -> Packing:
    with interpreted_only():
        rows = np.array([[0, 1, -1], [0, -1, 2], [-1, 1, 2]], np.int32)
        return assemble(rows, np.full(3, -1.0), np.ones(3, np.bool_), np.arange(3, dtype=np.int32)).component(0)
