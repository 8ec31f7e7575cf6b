"""Seconds that went into compiling kernels, or loading compiled ones and modules: no part of what a solver takes.

compiled.py tells when numba's compiler is entered and left; here they are added up, for each thread by itself. A
thread that waits until another has compiled waits for the compiler, too. It imports no numba: whoever reads this clock
need not compile.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from threading import get_ident

# by thread; every solution reads it, and a dictionary is quicker than threading.local
_total: dict[int, float] = {}
_under_way: dict[int, tuple[int, float]] = {}


def entered() -> None:
    """Note that the compiler was entered; it calls itself for the kernels that a kernel calls."""
    depth, since = _under_way.get(get_ident(), (0, 0.0))
    _under_way[get_ident()] = depth + 1, since if depth else time.perf_counter()


def left() -> None:
    """Note that the compiler was left."""
    # compilations that Ctrl-C cut short were forgotten by `compile_seconds`
    depth, since = _under_way.pop(get_ident(), (0, 0.0))
    if depth > 1:
        _under_way[get_ident()] = depth - 1, since
    elif depth == 1:
        _total[get_ident()] = _total.get(get_ident(), 0.0) + time.perf_counter() - since


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Count what is done within, an import, as loading."""
    entered()
    try:
        yield
    finally:
        left()


def is_compiling(seconds: float = 0.0) -> bool:
    """Whether some thread has been in the compiler, or importing, for so long."""
    now = time.perf_counter()
    return any(now - since > seconds for _, since in [*_under_way.values()])


def compile_seconds() -> float:
    """Return the seconds of this thread so far in which kernels were compiled or loaded, or modules imported.

    Who asks is not in the compiler: what seems under way was cut short by Ctrl-C on its way to the compiler's lock.
    """
    if _under_way:
        _under_way.pop(get_ident(), None)
    return _total.get(get_ident(), 0.0)
