"""Ctrl-C while kernels run, and requests to end early."""

from __future__ import annotations

import threading
from contextlib import ContextDecorator

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
