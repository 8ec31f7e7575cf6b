"""What the programs read: scenes and problems, ranges of scans, TOML files, and the types of their values."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from assoc._files.output import check_writable, is_stream
from assoc._text.plain import one_line
from assoc.errors import InvalidInputError


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
