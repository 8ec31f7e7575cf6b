"""Run work in a thread that is abandoned at a time limit or at Ctrl-C: for libraries that cannot be interrupted."""

from __future__ import annotations

import atexit
import math
import threading
from collections.abc import Callable
from typing import TypeVar, cast

Answer = TypeVar("Answer")

# seconds that stopped work may still take when Python ends
_EXIT_WAIT = 60.0
_POLL = 0.05
# bytes, as of a main thread; on some systems other threads have too little for a compiler
_STACK = 16 << 20
_stack_size = threading.Lock()


class StopSignal:
    """Stops work in another thread, at once or as soon as the work can be stopped."""

    def __init__(self) -> None:
        self.sent = False
        self._stop: Callable[[], object] | None = None

    def connect(self, stop: Callable[[], object]) -> None:
        """Set the function that stops the work, before the work starts."""
        self._stop = stop
        if self.sent:
            stop()

    def send(self) -> None:
        """Stop the work, at once or as soon as it is connected."""
        self.sent = True
        if self._stop is not None:
            self._stop()


def in_time(work: Callable[[], Answer], seconds: float, name: str, stop: StopSignal | None = None) -> Answer | None:
    """Return the result of the work, or None if it takes longer than ``seconds``; its exceptions are raised here.

    With infinite time the work still runs in a thread, so that Ctrl-C takes effect while a library works.
    The work must let other threads run, and goes on until it ends by itself after it is abandoned. With a `stop`
    signal it is asked to end, and gets some seconds to do so when Python ends: CP-SAT would otherwise abort the whole
    process (SIGABRT, whatever the program's exit code).
    """
    answers: list[Answer] = []
    errors: list[BaseException] = []

    def run_and_keep() -> None:
        try:
            answers.append(work())
        except BaseException as error:  # handed to the caller below
            errors.append(error)

    thread = threading.Thread(target=run_and_keep, name=name, daemon=True)
    try:
        with _stack_size:
            before = threading.stack_size(_STACK)
            try:
                thread.start()
            finally:
                threading.stack_size(before)
        # another thread may have received a signal: wake up regularly to handle it
        while seconds == math.inf and thread.is_alive():
            thread.join(_POLL)
        if seconds < math.inf:
            thread.join(max(seconds, 0.0))
    except BaseException:
        _abandon(stop, thread)
        raise
    if errors:
        raise errors[0]
    if answers:
        return answers[0]
    _abandon(stop, thread)
    return None


_of_thread = threading.local()


def uninterrupted(work: Callable[[], Answer]) -> Answer:
    """Return the result of the work; a signal handler's exception is raised in the waiting thread, never in the work.

    Handlers run in the main thread, which waits. Abandoned work ends at its next `end_if_abandoned`.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    stop = StopSignal()

    def run_until_stopped() -> Answer:
        _of_thread.stop = stop
        return work()

    return cast(Answer, in_time(run_until_stopped, math.inf, "compiler", stop))


def end_if_abandoned() -> None:
    """End the work of this thread if nobody waits for it any more."""
    stop = getattr(_of_thread, "stop", None)
    if stop is not None and stop.sent:
        raise KeyboardInterrupt


def _abandon(stop: StopSignal | None, thread: threading.Thread) -> None:
    if stop is not None:
        stop.send()
        _keep_until_exit(thread)


_left: list[threading.Thread] = []


def _keep_until_exit(thread: threading.Thread) -> None:
    """Keep a stopped thread until Python ends."""
    if not _left:
        # registering again after all have ended does no harm
        atexit.register(_join_at_exit)
    _left[:] = [other for other in _left if other.is_alive()] + [thread]


def _join_at_exit() -> None:
    for thread in _left:
        if thread.is_alive():
            thread.join(_EXIT_WAIT)
