"""What a program says beside its results: as much as is asked for, and never between data that go to stdout."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator, Sequence

from assoc._files.output import STDOUT

SPEECH_FLAGS = ("-q", "--quiet", "-v", "--verbose")


def add_speech_options(parser: argparse._ActionsContainer, more: str) -> None:
    """Add ``-q`` and ``-v``, which says ``more``."""
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but errors and warnings")
    parser.add_argument("-v", "--verbose", action="store_true", help=f"say more: {more}")


@contextlib.contextmanager
def spoken(*, quiet: bool, outputs: Sequence[str | None]) -> Iterator[None]:
    """Send what is printed nowhere if ``quiet``, and to stderr where an output is stdout."""
    with contextlib.ExitStack() as stack:
        if quiet:
            nowhere = stack.enter_context(open(os.devnull, "w"))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
        elif STDOUT in outputs:
            stack.enter_context(contextlib.redirect_stdout(sys.stderr))
        yield
