"""Copy an array element by element.

For each ``target[:] = source`` numba would compile the error message for unequal lengths into the kernel, which takes
longer than compiling most kernels.
"""

from __future__ import annotations

from assoc._system.compiled import lean_inner_njit
from assoc._types import Array


@lean_inner_njit
def copy_to(target: Array, source: Array) -> None:
    """Copy an array to another one of the same length."""
    for i in range(target.size):
        target[i] = source[i]
