"""Lines of text that fit a terminal: broken between words, never within a number."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import textwrap

_FIRST_COLUMN = re.compile(r"usage: |\s*\S.{0,24}?\s{2,}|\s*")
"""Indentation of continuation lines: a first column, or the blanks before the first word."""
_IN_BRACKETS = re.compile(r"\[[^][]*\]")
_JOIN = "\N{NO-BREAK SPACE}"


def print_lines(text: str) -> None:
    """Print lines to stdout; on a terminal long ones are broken between words."""
    print(fitted(text, shutil.get_terminal_size().columns) if sys.stdout.isatty() else text)


def fitted(text: str, width: int) -> str:
    """Break lines between words, but not in brackets, into lines of at most ``width`` (a longer word stays whole)."""
    return "\n".join(_fitted(line, width) for line in text.split("\n"))


def _fitted(line: str, width: int) -> str:
    if len(line) <= width:
        return line
    found = _FIRST_COLUMN.match(line)
    start = found.end() if found else 0
    if start > width // 2:
        start = 0
    rest = _IN_BRACKETS.sub(lambda part: part.group().replace(" ", _JOIN), line[start:])
    parts = textwrap.wrap(rest, width - start, break_long_words=False, break_on_hyphens=False)
    return (line[:start] + ("\n" + " " * start).join(parts)).replace(_JOIN, " ")


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Prints descriptions and epilogs as written, in lines that fit."""

    def format_help(self) -> str:
        """Return the help."""
        return fitted(super().format_help(), self._width)
