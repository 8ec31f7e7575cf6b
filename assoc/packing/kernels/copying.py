"""Copying one list over another one, number by number.

``target[:] = source`` would do the same. With each such line numba compiles into a kernel the text of the error for
lengths that differ, and that takes longer than most kernels.
"""

from __future__ import annotations

from typing import Any

from assoc._system.compiled import inner_njit


@inner_njit
def copy_to(target: Any, source: Any) -> None:
    """Copy a list over another one of the same length."""
    for i in range(target.size):
        target[i] = source[i]
