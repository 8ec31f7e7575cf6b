"""What the programs read and write: TOML files, and outputs that can be written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from assoc._files.output import STDOUT, check_writable, is_stream
from assoc._files.reading import read_bytes
from assoc._text.plain import one_line
from assoc.errors import InvalidInputError

_LARGEST = 1_000_000


def read_toml(path: str) -> dict[str, Any]:
    """Read a TOML file; keys may have dashes for underscores.

    Raises
    ------
    InvalidInputError
        It cannot be read, or is no TOML.
    """
    import tomllib  # only with --config

    try:
        content = tomllib.loads(read_bytes(path, _LARGEST).decode())
    except InvalidInputError:
        raise
    except (ValueError, RecursionError) as error:  # TOMLDecodeError and UnicodeDecodeError
        raise InvalidInputError(f"{path}: is not a TOML file ({one_line(error)})") from None
    return {key.replace("-", "_"): value for key, value in content.items()}


def check_outputs(
    outputs: Sequence[str | None],
    inputs: Sequence[str | None],
    *,
    reserved: Sequence[str] = (),
    new_folder: str | None = None,
) -> None:
    """Refuse before the work outputs that could not be written after it.

    Parameters
    ----------
    outputs, inputs : sequences of str or None
        Files that are written and read; None for options that were not given.
    reserved : sequence of str
        Other files that must not be overwritten.
    new_folder : str, optional
        A folder that the program will make.

    Raises
    ------
    InvalidInputError
        An output would overwrite an input or another output, is a folder, or its folder does not exist or takes
        no files.
    """
    taken = {_real_path(path) for path in (*inputs, *reserved) if path}
    for path in outputs:
        if not path or is_stream(path):
            continue
        if _real_path(path) in taken:
            raise InvalidInputError(f"{path}: is given twice, or would overwrite an input file")
        taken.add(_real_path(path))
    for path in outputs:
        if path:
            check_writable(path, folder_to_come=new_folder)


FORMATS = (".npz", ".json", ".csv", ".parquet", ".html", ".htm", ".toml", ".png", ".pdf", ".xlsx")
"""Endings by which people know what is in a file."""


def check_ending(path: str | None, option: str, *endings: str, strict: bool = True) -> str:
    """Refuse a file whose name promises something else than is written; returns its ending, the first for streams.

    Parameters
    ----------
    path : str or None
        None where the option was not given.
    option : str
        What the message begins with.
    endings : str
        What it may end in.
    strict : bool, default True
        Whether the ending must be one of these; otherwise it must only be none of another format.

    Raises
    ------
    InvalidInputError
        The name ends in something else.
    """
    if path is None or path == STDOUT or is_stream(path):
        return endings[0]
    ending = os.path.splitext(path)[1].lower()
    if ending in endings or not (strict or ending in FORMATS):
        return ending
    raise InvalidInputError(f"{option}: {path}: expected a name that ends in {' or '.join(endings)}")


def _real_path(path: str) -> str:
    try:
        return os.path.realpath(path)
    except ValueError:  # a NUL, which TOML can hold: reading or writing will say so
        return path
