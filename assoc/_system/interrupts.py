"""Ctrl-C in the middle of kernels."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator


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
