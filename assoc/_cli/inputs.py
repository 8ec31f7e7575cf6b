"""What the programs read: scenes and problems, ranges of scans, TOML files, and the types of their values."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.program import one_line
from assoc._files.npz import format_of
from assoc._files.output import check_writable, is_stream
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.problem import AssignmentProblem
    from assoc.scene.scene import Scene


def load_source(path: str) -> Scene | AssignmentProblem:
    """Load a scene or a problem, whichever the file says it is.

    Raises
    ------
    InvalidInputError
        It is neither, or cannot be read.
    """
    found = format_of(path)
    if found == "assoc.problem":
        from assoc.problem import AssignmentProblem

        return AssignmentProblem.load(path)
    if found is not None and found != "assoc.scene":
        raise InvalidInputError(f"{path}: has the format {found[:60]!r}, expected 'assoc.scene' or 'assoc.problem'")
    from assoc.scene.scene import Scene

    return Scene.load(path)


def scan_range(text: str, count: int, name: str) -> range:
    """Parse A:B or A, within the scans of the source ``name``.

    Raises
    ------
    InvalidInputError
        It is not of that form, or reaches beyond.
    """
    first, colon, last = text.partition(":")
    try:
        start = int(first) if first or not colon else 0
        stop = (int(last) if last else count) if colon else start + 1
    except ValueError:
        raise InvalidInputError(f"--scans: expected A:B or A in whole numbers, got {text!r}") from None
    if not 0 <= start < stop <= count:
        raise InvalidInputError(f"--scans: {text} is not within the scans 0:{count} of {name}")
    return range(start, stop)


def number(text: str, label: str) -> float:
    """Parse a number."""
    try:
        return float(text)
    except ValueError:
        raise InvalidInputError(f"{label}: expected a number, got {text!r}") from None


def read_toml(path: str) -> dict[str, Any]:
    """Read a TOML file; keys may have dashes for underscores.

    Raises
    ------
    InvalidInputError
        It cannot be read, or is no TOML.
    """
    import tomllib

    try:
        with open(path, "rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError and UnicodeDecodeError
        raise InvalidInputError(f"{path}: is not a TOML file ({one_line(error)})") from None
    return {key.replace("-", "_"): value for key, value in content.items()}


def check_kind(value: Any, kind: type, label: str) -> None:
    """Refuse a value of a file that is not text (str), a number (float) or a whole number (int)."""
    taken: Any = (int, float) if kind is float else kind
    if not isinstance(value, taken) or isinstance(value, bool):
        expected = {str: "text", float: "a number"}.get(kind, "a whole number")
        raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")


def check_output(path: str, folder_to_come: str | None = None) -> None:
    """Refuse before the work a file that could not be written after it.

    Raises
    ------
    InvalidInputError
        It is a folder, or would be in one that takes no files, or does not exist and is not ``folder_to_come``.
    """
    check_writable(path, folder_to_come=folder_to_come)


def check_distinct(outputs: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse outputs that would overwrite what is read, or each other."""
    taken = {_place(path) for path in inputs}
    for path in outputs:
        if is_stream(path):
            continue
        if _place(path) in taken:
            raise InvalidInputError(f"{path}: is given twice, or would overwrite what is read")
        taken.add(_place(path))


def _place(path: str) -> str:
    try:
        return os.path.realpath(path)
    except ValueError:  # a NUL, which TOML can hold: reading or writing will say so
        return path
