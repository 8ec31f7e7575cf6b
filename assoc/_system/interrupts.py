"""Ctrl-C in the middle of kernels, and work that is asked to come to its end."""

from __future__ import annotations

import threading
from contextlib import ContextDecorator

_end_asked = threading.Event()


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
