"""Warnings of programs: one line each on stderr, and each line once."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from assoc._text.plain import one_line
from assoc.errors import AssocWarning


@contextmanager
def warnings_as_lines(name: str) -> Iterator[None]:
    """Print each `AssocWarning` as a line of the program `name`; other warnings stay what they are."""
    said: set[str] = set()
    with warnings.catch_warnings():
        usual = warnings.showwarning

        def show(message: Any, category: Any, *rest: Any, **named: Any) -> None:
            if not issubclass(category, AssocWarning):
                usual(message, category, *rest, **named)
            elif str(message) not in said:
                said.add(str(message))
                print(f"{name}: warning: {one_line(message)}", file=sys.stderr)

        warnings.showwarning = show
        warnings.simplefilter("always", AssocWarning)
        yield
