"""Work in a thread that is abandoned when time is over: for libraries that have no time limit, or check it seldom."""

from __future__ import annotations

import atexit
import math
import threading
from collections.abc import Callable
from typing import TypeVar

Answer = TypeVar("Answer")

# seconds that work which was told to stop is given when Python ends
_FAREWELL = 10.0
_LOOK = 0.2


class StopSignal:
    """Tells work in another thread to stop, from whenever it can be told."""

    def __init__(self) -> None:
        self._sent = False
        self._stop: Callable[[], object] | None = None

    def connect(self, stop: Callable[[], object]) -> None:
        """Say how the work is stopped, before it starts."""
        self._stop = stop
        if self._sent:
            stop()

    def send(self) -> None:
        """Stop the work, at once or as soon as it is connected."""
        self._sent = True
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
    thread.start()
    try:
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
    _left[:] = [one for one in _left if one.is_alive()]
    _left.append(thread)


def _take_leave() -> None:
    for one in _left:
        one.join(_FAREWELL)
