"""Plain text that is safe to print on a terminal."""

from __future__ import annotations


def one_line(message: object) -> str:
    """Return a message without line breaks and control characters."""
    return printable(" ".join(str(message).split()))


def printable(text: str) -> str:
    """Return text with control characters escaped; file names may contain any."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def spreadsheet_text(text: str) -> str:
    """Return text for a cell of a CSV file, escaped so that no spreadsheet reads it as a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
