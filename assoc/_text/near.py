"""Suggestions for mistyped names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# names that are so much less similar than the nearest one are not suggested
_MUCH = 0.15


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return a question that suggests similar names; empty if there are none."""
    # the dashes of options would make any two similar
    bare, plain = str(name).lstrip("-"), {one.lstrip("-"): one for one in known}
    close = difflib.get_close_matches(bare, [*plain], n=3)
    likeness = [difflib.SequenceMatcher(None, one, bare).ratio() for one in close]
    close = [one for one, ratio in zip(close, likeness, strict=True) if ratio > likeness[0] - _MUCH]
    return "did you mean " + " or ".join(plain[one] for one in close) + "?" if close else ""
