"""Seconds spent on compiling or loading kernels and on importing modules: solvers do not count them as their time.

They are counted for each thread; waiting for another thread that compiles counts as well. This module does not import
numba, so that reading the counter stays cheap.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from threading import get_ident

# by thread; read for every solution, where a dictionary is quicker than threading.local
_total: dict[int, float] = {}
_under_way: dict[int, float] = {}


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Count the time within, compiling or an import, as loading; nested uses count once."""
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
    """Whether some thread has been compiling or importing for more than ``seconds``."""
    now = time.perf_counter()
    return any(now - since > seconds for since in [*_under_way.values()])


def compile_seconds() -> float:
    """Return the seconds that this thread has spent on compiling or loading kernels, or importing modules."""
    return _total.get(get_ident(), 0.0)
