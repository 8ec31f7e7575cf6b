"""Seconds that went into compiling kernels, or loading compiled ones and modules: no part of what a solver takes.

They are added up for each thread by itself. A thread that waits until another has compiled waits for the compiler,
too. It imports no numba: whoever reads this clock need not compile.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from threading import get_ident

# by thread; every solution reads it, and a dictionary is quicker than threading.local
_total: dict[int, float] = {}
_under_way: dict[int, float] = {}


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Count what is done within, compiling or an import, as loading; once where one is within another."""
    thread = get_ident()
    if thread in _under_way:
        yield
        return
    _under_way[thread] = started = time.perf_counter()
    try:
        yield
    finally:
        del _under_way[thread]
        _total[thread] = _total.get(thread, 0.0) + time.perf_counter() - started


def is_compiling(seconds: float = 0.0) -> bool:
    """Whether some thread has been in the compiler, or importing, for so long."""
    now = time.perf_counter()
    return any(now - since > seconds for since in [*_under_way.values()])


def compile_seconds() -> float:
    """Return the seconds of this thread so far in which kernels were compiled or loaded, or modules imported."""
    return _total.get(get_ident(), 0.0)
