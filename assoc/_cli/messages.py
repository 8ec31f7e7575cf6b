"""Messages of a program beside its data: never between data on stdout, none with ``-q``, warnings as lines."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from assoc._cli.options import Given
from assoc._files.output import STDOUT
from assoc._system.compile_time import announcement
from assoc._text.plain import one_line
from assoc.errors import AssocWarning


@contextlib.contextmanager
def messages(given: Given) -> Iterator[None]:
    """Discard printed text with ``--quiet``, and send it to stderr where an output is stdout."""
    with contextlib.ExitStack() as stack:
        if given["quiet"]:
            nowhere = stack.enter_context(open(os.devnull, "w"))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
            stack.enter_context(announcement.silenced())
        elif STDOUT in [given[name] for name in given.outputs]:
            stack.enter_context(contextlib.redirect_stdout(sys.stderr))
        yield


@contextlib.contextmanager
def warnings_as_lines(name: str) -> Iterator[None]:
    """Print each `AssocWarning` once, as a line of the program `name`; other warnings are unchanged."""
    printed: set[str] = set()
    with warnings.catch_warnings():
        usual = warnings.showwarning

        def show(message: Any, category: Any, *rest: Any, **named: Any) -> None:
            if not issubclass(category, AssocWarning):
                usual(message, category, *rest, **named)
            elif str(message) not in printed:
                printed.add(str(message))
                print(f"{name}: warning: {one_line(message)}", file=sys.stderr)

        warnings.showwarning = show
        warnings.simplefilter("always", AssocWarning)
        yield
