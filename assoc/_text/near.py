"""Suggestions for mistyped names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

# names that are so much less similar than the nearest one are not suggested
_MUCH = 0.15


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return a question that suggests similar names; empty if there are none."""
    # the dashes of options would make any two similar
    bare, plain = str(name).lstrip("-"), {word.lstrip("-"): word for word in known}
    close = difflib.get_close_matches(bare, [*plain], n=3)
    likeness = [difflib.SequenceMatcher(None, word, bare).ratio() for word in close]
    close = [word for word, ratio in zip(close, likeness, strict=True) if ratio > likeness[0] - _MUCH]
    return "did you mean " + " or ".join(plain[word] for word in close) + "?" if close else ""
