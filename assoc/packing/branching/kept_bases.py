"""The bases of the latest branchings, so that their other sides do not have to compute them anew.

Depth first, the second side of a branching is searched after the whole subtree of the first. Recomputing the inverse of
its basis takes as long as dozens of pivots, copying it as long as one. A kept basis is identified by its variables,
which determine the inverse.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assoc._system.compiled import inner_njit
from assoc._system.kernels.copying import copy_to
from assoc._types import Floats
from assoc.packing.simplex.basis import Basis
from assoc.packing.simplex.program import Program

# most bases kept, and most elements of all their inverses
_BASES, _ELEMENTS = 8, 4_000_000


class KeptBases(NamedTuple):
    """Up to ``K`` bases of ``m`` rows; a new one replaces the oldest."""

    variable: NDArray[np.int32]
    """As in `Basis`; -1 in unused entries, (K, m)."""
    inverse: Floats
    """(K, m, m); norms (K, m), ages (K,)."""
    norms: Floats
    age: NDArray[np.int64]
    latest: NDArray[np.int64]
    """Index of the latest one, (1,)."""


def kept_memory(rows: float) -> float:
    """Bytes of the inverses."""
    return 8.0 * min(_BASES * rows * rows, _ELEMENTS)


def no_kept_bases(program: Program, elements: int = _ELEMENTS) -> KeptBases:
    """Allocate kept bases of a program, fewer where they are large: at most so many elements of all their inverses."""
    size = program.sides.size
    count = min(_BASES, elements // max(size * size, 1))
    return KeptBases(
        np.full((count, size), -1, np.int32), np.empty((count, size, size)), np.empty((count, size)),
        np.zeros(count, np.int64), np.zeros(1, np.int64),
    )  # fmt: skip


@inner_njit
def keep_basis(kept: KeptBases, basis: Basis) -> None:
    """Keep a copy of a basis."""
    count = kept.age.size
    if count > 0:
        position = (kept.latest[0] + 1) % count
        kept.latest[0] = position
        copy_to(kept.variable[position], basis.variable)
        for r in range(basis.values.size):
            copy_to(kept.inverse[position, r], basis.inverse[r])
        copy_to(kept.norms[position], basis.norms)
        kept.age[position] = basis.age[0]


@inner_njit
def take_kept(kept: KeptBases, program: Program, basis: Basis, again: bool) -> bool:
    """Copy the kept basis of the same variables, except multipliers and anchors, to ``basis``; False if there is none.

    ``again``: it will be needed once more.
    """
    count, num, size = kept.age.size, program.weights.size, program.sides.size
    position = -1
    for back in range(count):
        candidate = (kept.latest[0] + count - back) % count
        i = 0
        while i < size and kept.variable[candidate, i] == basis.variable[i]:
            i += 1
        if i == size:
            position = candidate
            break
    if position >= 0:
        # bases kept after it belong to nodes that are done
        kept.latest[0] = position if again else (position + count - 1) % count
        # right-hand sides may have changed (counts.py)
        basis.values[:] = 0.0
        for r in range(size):
            for i in range(size):
                entry = kept.inverse[position, r, i]
                basis.inverse[r, i] = entry
                basis.values[i] += program.sides[r] * entry
        copy_to(basis.norms, kept.norms[position])
        basis.age[0] = kept.age[position]
        basis.position[:] = -1
        basis.slack_position[:] = -1
        for i in range(size):
            code = basis.variable[i]
            if code < num:
                basis.position[code] = i
            elif code < num + size:
                basis.slack_position[code - num] = i
    return position >= 0
