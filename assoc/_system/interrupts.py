"""Ctrl-C, time limits and requests to end early, where kernels and libraries work that know nothing of them."""

from __future__ import annotations

import atexit
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import ContextDecorator
from typing import TypeVar, cast

Answer = TypeVar("Answer")

# seconds that stopped work may still take when Python ends
_EXIT_WAIT = 60.0
_POLL = 0.05
# bytes, as of a main thread; on some systems other threads have too little for a compiler
_STACK = 16 << 20
_stack_size = threading.Lock()


_end_asked = threading.Event()


def ask_to_end() -> None:
    """Ask the searches of this process to return the best they have, and loops over scans to start no further scan."""
    _end_asked.set()


def end_is_asked() -> bool:
    """Whether this program was asked to end."""
    return _end_asked.is_set()


class interruptible(ContextDecorator):  # noqa: N801 - read like those of contextlib
    """Raise KeyboardInterrupt where Ctrl-C arrives while a kernel's arguments or results are converted.

    There Python finds a result together with an exception and raises SystemError, once for each nested conversion.
    This is a class because a generator would cost time in every solution of a tiny scene.
    """

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        cause = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(error, SystemError) and isinstance(cause, KeyboardInterrupt):
            raise cause from None


def in_time(
    work: Callable[[], Answer], seconds: float, name: str, stop: threading.Event | None = None
) -> Answer | None:
    """Return the result of the work, or None if it takes longer than ``seconds``; its exceptions are raised here.

    With infinite time the work still runs in a thread, so that Ctrl-C takes effect while a library works.
    The work must let other threads run, and goes on until it ends by itself after it is abandoned. A `stop` is set
    then, and work that looks at it gets some seconds to end before Python does.
    """
    answer: Future[Answer] = Future()

    def run_and_keep() -> None:
        try:
            answer.set_result(work())
        except BaseException as error:  # raised below
            answer.set_exception(error)

    thread = threading.Thread(target=run_and_keep, name=name, daemon=True)
    last = time.monotonic() + seconds
    try:
        with _stack_size:
            before = threading.stack_size(_STACK)
            try:
                thread.start()
            finally:
                threading.stack_size(before)
        # another thread may have received a signal: wake up regularly to handle it
        while thread.is_alive() and (left := last - time.monotonic()) > 0.0:
            thread.join(min(left, _POLL))
    except BaseException:
        _abandon(stop, thread)
        raise
    if answer.done():
        return answer.result()
    _abandon(stop, thread)
    return None


_of_thread = threading.local()


def uninterrupted(work: Callable[[], Answer]) -> Answer:
    """Return the result of the work; a signal handler's exception is raised in the waiting thread, never in the work.

    Handlers run in the main thread, which waits. Abandoned work ends at its next `end_if_abandoned`.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    stop = threading.Event()

    def run_until_stopped() -> Answer:
        _of_thread.stop = stop
        return work()

    return cast(Answer, in_time(run_until_stopped, math.inf, "compiler", stop))


def end_if_abandoned() -> None:
    """End the work of this thread if nobody waits for it any more."""
    stop = getattr(_of_thread, "stop", None)
    if stop is not None and stop.is_set():
        raise KeyboardInterrupt


_left: list[threading.Thread] = []


def _abandon(stop: threading.Event | None, thread: threading.Thread) -> None:
    """Stop the work of a thread, if it can be stopped, and let it end before Python does."""
    if stop is not None:
        stop.set()
        if not _left:
            # before what was registered earlier
            atexit.register(_join_at_exit)
        _left[:] = [other for other in _left if other.is_alive()] + [thread]


def _join_at_exit() -> None:
    for thread in _left:
        thread.join(_EXIT_WAIT)
