"""Names that were mistyped: which known ones are near."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# what is so much less like the name than the nearest one was not meant
_MUCH = 0.15


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Ask for the names that are near; empty if none is."""
    # the dashes of options make any two of them alike
    bare, plain = str(name).lstrip("-"), {one.lstrip("-"): one for one in known}
    close = difflib.get_close_matches(bare, [*plain], n=3)
    likeness = [difflib.SequenceMatcher(None, one, bare).ratio() for one in close]
    close = [one for one, ratio in zip(close, likeness, strict=True) if ratio > likeness[0] - _MUCH]
    return "did you mean " + " or ".join(plain[one] for one in close) + "?" if close else ""
