"""Ctrl-C in the middle of kernels, and work that is asked to come to its end."""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Iterator
from contextlib import ContextDecorator, contextmanager

_end_asked = threading.Event()

# signals whose handlers may raise an exception
_ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM") if hasattr(signal, name)]


def ask_to_end() -> None:
    """Ask the searches of this process to end with what they have, and loops over scans to begin no other."""
    _end_asked.set()


def end_is_asked() -> bool:
    """Whether a program was asked to come to its end."""
    return _end_asked.is_set()


class interruptible(ContextDecorator):  # noqa: N801 - read like those of contextlib
    """Let Ctrl-C be a KeyboardInterrupt where it comes while a kernel's arguments or results are converted.

    Python then sees a function that returns a result and has an exception set, and says SystemError; once for
    every conversion that is nested in another. A class, as every solution of a tiny scene pays for a generator.
    """

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        cause = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(error, SystemError) and isinstance(cause, KeyboardInterrupt):
            raise cause from None


@contextmanager
def signals_held() -> Iterator[None]:
    """Let handlers of signals run after the block: for libraries that call Python where nothing may be raised.

    A mask would not do: a signal that another thread takes runs its handler in the main thread all the same.
    """
    if threading.current_thread() is not threading.main_thread():
        # handlers run in the main thread only
        yield
        return
    came: list[signal.Signals] = []
    held = {number: handler for number in _ENDING if callable(handler := signal.getsignal(number))}
    try:
        for number in held:
            signal.signal(number, lambda number, frame: came.append(signal.Signals(number)))
        yield
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
        for number in dict.fromkeys(came):
            # as if it came now, also where programs have blocked it and wait for it in a thread
            _thread.interrupt_main(number)
