"""Ctrl-C in the middle of kernels."""

from __future__ import annotations

from contextlib import ContextDecorator


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
