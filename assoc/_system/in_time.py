"""Work in a thread that is abandoned when time is over, or at Ctrl-C: for libraries that do not end by themselves."""

from __future__ import annotations

import atexit
import math
import threading
from collections.abc import Callable
from typing import TypeVar, cast

Answer = TypeVar("Answer")

# seconds that work which was told to stop is given when Python ends
_FAREWELL = 60.0
_LOOK = 0.05
# bytes: what a main thread has; some systems give other threads too little for a compiler
_STACK = 16 << 20
_stack_size = threading.Lock()


class StopSignal:
    """Tells work in another thread to stop, from whenever it can be told."""

    def __init__(self) -> None:
        self.sent = False
        self._stop: Callable[[], object] | None = None

    def connect(self, stop: Callable[[], object]) -> None:
        """Say how the work is stopped, before it starts."""
        self._stop = stop
        if self.sent:
            stop()

    def send(self) -> None:
        """Stop the work, at once or as soon as it is connected."""
        self.sent = True
        if self._stop is not None:
            self._stop()


def in_time(work: Callable[[], Answer], seconds: float, name: str, stop: StopSignal | None = None) -> Answer | None:
    """Return what the work returns, or None when it is not back in that time; what it raises is raised.

    The time may be infinite: then the work is done aside so that Ctrl-C is heard while a library is at it.
    The work must let other threads run and must not mind being forgotten: it goes on until it ends by itself. With a
    `stop` signal it is told to end, and when Python ends it is given some seconds to do so: CP-SAT would take the
    whole process with it (SIGABRT, whatever the program's exit code was to be).
    """
    answers: list[Answer] = []
    errors: list[BaseException] = []

    def run_aside() -> None:
        try:
            answers.append(work())
        except BaseException as error:  # handed to the caller below
            errors.append(error)

    thread = threading.Thread(target=run_aside, name=name, daemon=True)
    try:
        with _stack_size:
            before = threading.stack_size(_STACK)
            try:
                thread.start()
            finally:
                threading.stack_size(before)
        # a signal may have come to another thread: this one looks now and then
        while seconds == math.inf and thread.is_alive():
            thread.join(_LOOK)
        if seconds < math.inf:
            thread.join(max(seconds, 0.0))
    except BaseException:
        _tell(stop, thread)
        raise
    if errors:
        raise errors[0]
    if answers:
        return answers[0]
    _tell(stop, thread)
    return None


_of_thread = threading.local()


def uninterrupted(work: Callable[[], Answer]) -> Answer:
    """Return what the work returns; an exception of a signal's handler is raised beside it, never within it.

    Handlers run in the main thread, which waits. What it no longer waits for ends at the next `end_if_abandoned`.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    stop = StopSignal()

    def run_until_stopped() -> Answer:
        _of_thread.stop = stop
        return work()

    return cast(Answer, in_time(run_until_stopped, math.inf, "compiler", stop))


def end_if_abandoned() -> None:
    """End the work of this thread here if nobody waits for it any more."""
    stop = getattr(_of_thread, "stop", None)
    if stop is not None and stop.sent:
        raise KeyboardInterrupt


def _tell(stop: StopSignal | None, thread: threading.Thread) -> None:
    if stop is not None:
        stop.send()
        _leave(thread)


_left: list[threading.Thread] = []


def _leave(thread: threading.Thread) -> None:
    """Remember a thread that was told to stop until Python ends."""
    if not _left:
        # registered once more where all have ended: that does no harm
        atexit.register(_take_leave)
    _left[:] = [one for one in _left if one.is_alive()] + [thread]


def threads_left() -> bool:
    """Whether there is work under way that nobody waits for."""
    return any(one.is_alive() for one in _left)


def _take_leave() -> None:
    for one in _left:
        if one.is_alive():
            one.join(_FAREWELL)
