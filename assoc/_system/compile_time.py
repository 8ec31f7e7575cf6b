"""Seconds that went into compiling kernels, or loading compiled ones and modules: no part of what a solver takes.

compiled.py tells when numba's compiler is entered and left; here they are added up, for each thread by itself. A
thread that waits until another has compiled waits for the compiler, too. It imports no numba: whoever reads this clock
need not compile.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator


class _Clock(threading.local):
    """The compiling of one thread."""

    depth = 0
    since = 0.0
    total = 0.0


_clock = _Clock()


def entered() -> None:
    """Note that the compiler was entered; it calls itself for the kernels that a kernel calls."""
    if _clock.depth == 0:
        _clock.since = time.perf_counter()
    _clock.depth += 1


def left() -> None:
    """Note that the compiler was left."""
    # compilations that Ctrl-C cut short were forgotten by `compile_seconds`
    if _clock.depth > 0:
        _clock.depth -= 1
        if _clock.depth == 0:
            _clock.total += time.perf_counter() - _clock.since


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Count what is done within, an import, as loading."""
    entered()
    try:
        yield
    finally:
        left()


def compile_seconds() -> float:
    """Return the seconds of this thread so far in which kernels were compiled or loaded, or modules imported.

    Who asks is not in the compiler: what seems under way was cut short by Ctrl-C on its way to the compiler's lock.
    """
    _clock.depth = 0
    return _clock.total
