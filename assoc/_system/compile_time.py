"""Seconds spent on compiling or loading kernels and on importing modules: solvers do not count them as their time.

They are counted for each thread; waiting for another thread that compiles counts as well. This module does not import
numba, so that reading the counter stays cheap.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterator
from threading import get_ident

# by thread; read for every solution, where a dictionary is quicker than threading.local
_total: dict[int, float] = {}
_under_way: dict[int, float] = {}
_LINE = "assoc: compiling kernels, once after installation (assoc.warm_up() does it ahead)"


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


class Announcement:
    """Says once, on stderr, that kernels are compiled, when that has taken ``patience`` seconds together."""

    def __init__(self, patience: float = 2.0) -> None:
        self._left = patience
        self._since: float | None = None
        self._timer: threading.Timer | None = None
        self._silent = False

    def begin(self) -> None:
        """Note that a kernel is compiled now, not only loaded."""
        if self._silent or self._since is not None:
            return
        self._since, self._timer = time.perf_counter(), threading.Timer(self._left, self._say)
        self._timer.daemon = True
        self._timer.start()

    def end(self) -> None:
        """Note that it is ready."""
        if self._timer is not None and self._since is not None:
            self._timer.cancel()
            self._left -= time.perf_counter() - self._since
            self._since = self._timer = None

    @contextlib.contextmanager
    def silenced(self) -> Iterator[None]:
        """Say nothing within: for those who say it themselves, or were asked to be quiet."""
        before, self._silent = self._silent, True
        try:
            yield
        finally:
            self._silent = before

    def _say(self) -> None:
        import multiprocessing  # few calls come here

        if not self._silent and sys.stderr is not None and multiprocessing.parent_process() is None:
            self._silent = True
            print(_LINE, file=sys.stderr, flush=True)


announcement = Announcement()


def is_compiling(seconds: float = 0.0) -> bool:
    """Whether some thread has been compiling or importing for more than ``seconds``."""
    now = time.perf_counter()
    return any(now - since > seconds for since in [*_under_way.values()])


def compile_seconds(thread: int | None = None) -> float:
    """Return the seconds that a thread (this one) has spent on compiling or loading kernels, or importing modules."""
    return _total.get(get_ident() if thread is None else thread, 0.0)
