"""What a fault is."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One fault.

    Attributes
    ----------
    what : str
        What is wrong then.
    file : str
        The file, from the folder of the project.
    old, new : str
        The text, and what replaces it.
    test : str
        The test file that must fail.
    """

    what: str
    file: str
    old: str
    new: str
    test: str
