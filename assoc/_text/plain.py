"""Plain text that is safe to print on a terminal."""

from __future__ import annotations


def one_line(message: object) -> str:
    """Return a message with its line breaks taken out, and nothing in it that a terminal would obey."""
    return printable(" ".join(str(message).split()))


def printable(text: str) -> str:
    """Return text on one line that shows as it is; the names of files may hold anything."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)
