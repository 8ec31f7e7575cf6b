"""Errors that the package raises on purpose, all ValueErrors with a one-line message; and its warnings."""

from __future__ import annotations

import sys
import warnings


class AssocError(ValueError):
    """Base of every error that assoc raises on purpose."""


class InvalidInputError(AssocError):
    """A file, field or argument is wrong; the message names it and what was expected."""


class InfeasibleError(AssocError):
    """The problem has no solution (possible only without dummies), or none was found."""


class LimitExceededError(AssocError):
    """The work exceeds a limit; the message gives the number and what to change."""


class MissingExtraError(AssocError, ImportError):
    """An optional dependency is not installed; the message names the command that installs it."""


class RemovedError(AssocError, ImportError):
    """A public name existed once; the message says what to use instead."""


class AssocWarning(UserWarning):
    """Legal input that is probably a mistake, such as degrees instead of radians; one line."""


def warn(message: str) -> None:
    """Issue an `AssocWarning` at the line of the user's code that called the package."""
    level = 2  # stack level of `frame`, seen from `warnings.warn`
    frame = sys._getframe(1)
    # decorators put contextlib between the package and its caller
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in ("assoc", "contextlib"):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, AssocWarning, stacklevel=level)
