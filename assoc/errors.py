"""The errors that the package raises on purpose, all ValueErrors with one clear line; and its warnings."""

from __future__ import annotations

import sys
import warnings


class AssocError(ValueError):
    """Base of every error that assoc raises on purpose."""


class InvalidInputError(AssocError):
    """A file, field or argument is not what it should be; the message names it and what was expected."""


class InfeasibleError(AssocError):
    """The problem has no solution at all (possible only without dummies), or no solution was found."""


class LimitExceededError(AssocError):
    """The work asked for exceeds a stated limit; the message gives the number and what to change."""


class MissingExtraError(AssocError, ImportError):
    """An optional dependency is not installed; the message names the command that installs it."""


class AssocWarning(UserWarning):
    """What is legal and almost surely a mistake, as degrees where radians are meant; one clear line."""


def warn(message: str) -> None:
    """Issue an `AssocWarning` at the line of the user's code that called the package."""
    level = 2  # where `frame` stands, seen from `warnings.warn`
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "assoc":
        frame, level = frame.f_back, level + 1
    warnings.warn(message, AssocWarning, stacklevel=level)
