"""Plain text that is safe to print on a terminal."""

from __future__ import annotations


def one_line(message: object) -> str:
    """Return a message without line breaks and control characters."""
    return printable(" ".join(str(message).split()))


def printable(text: str) -> str:
    """Return text with control characters escaped; file names may contain any."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode() for sign in text)


def spreadsheet_text(text: str) -> str:
    """Return text for a cell of a CSV file, escaped so that no spreadsheet reads it as a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
