"""Ctrl-C in the middle of kernels, and work that is asked to come to its end."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

_end_asked = threading.Event()


def ask_to_end() -> None:
    """Ask the searches of this process to end with what they have, and loops over scans to begin no other."""
    _end_asked.set()


def end_is_asked() -> bool:
    """Whether a program was asked to come to its end."""
    return _end_asked.is_set()


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C be a KeyboardInterrupt where it comes while a kernel's arguments or results are converted.

    Python then sees a function that returns a result and has an exception set, and says SystemError; once for
    every conversion that is nested in another.
    """
    try:
        yield
    except SystemError as error:
        cause: BaseException | None = error
        while isinstance(cause, SystemError):
            cause = cause.__cause__
        if isinstance(cause, KeyboardInterrupt):
            raise cause from None
        raise
