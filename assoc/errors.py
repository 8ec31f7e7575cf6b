"""The errors that the package raises on purpose; all are ValueErrors with one clear line."""

from __future__ import annotations


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
