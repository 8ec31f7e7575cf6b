"""Names that were mistyped: which known ones are near."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Ask for the names that are near; empty if none is."""
    close = difflib.get_close_matches(str(name), [*known], n=3)
    return "did you mean " + " or ".join(close) + "?" if close else ""
