"""Plain text that is safe to print on a terminal."""

from __future__ import annotations


def one_line(message: object) -> str:
    """Return a message without line breaks and without control characters."""
    return printable(" ".join(str(message).split()))


def printable(text: str) -> str:
    """Return text with control characters escaped; names of files may contain any."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def spreadsheet_text(text: str) -> str:
    """Return text for a cell of a CSV file that no spreadsheet takes for a formula: names of files may be any text."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
