"""Input that programs read before their options: TOML files, and users' modules; several of its errors at once."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from assoc._files.reading import read_bytes
from assoc._text.plain import one_line
from assoc.errors import AssocError, InvalidInputError

_LARGEST = 1_000_000


def read_toml(path: str) -> dict[str, Any]:
    """Read a TOML file; keys may have dashes for underscores."""
    import tomllib  # only with --config

    try:
        content = tomllib.loads(read_bytes(path, _LARGEST).decode())
    except InvalidInputError:
        raise
    except (ValueError, RecursionError) as error:  # TOMLDecodeError and UnicodeDecodeError
        raise InvalidInputError(f"{path}: is not a TOML file ({one_line(error)})") from None
    return {key.replace("-", "_"): value for key, value in content.items()}


def import_modules(names: str | None) -> None:
    """Import modules by their names, separated by commas; modules in the current folder are found."""
    if names is None:
        return
    folder = os.getcwd()
    # last in the search path: no other import finds files here; worker processes get the same path
    if folder not in sys.path and "" not in sys.path:
        sys.path.append(folder)
    for name in names.split(","):
        if name.endswith(".py") or os.sep in name:
            raise InvalidInputError(f"--import: expected the name of a module (mine, not mine.py), got {name!r}")
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and (name == error.name or name.startswith(error.name + ".")):
                raise InvalidInputError(f"--import: no module {name!r} in the current folder or installed") from None
            raise InvalidInputError(f"--import: {name} cannot be imported ({error})") from None
        except Exception as error:  # a user's module may raise anything
            raise InvalidInputError(f"--import: {name} cannot be imported ({type(error).__name__}: {error})") from None


def with_others(errors: Sequence[AssocError]) -> AssocError:
    """The first of several errors, which brings the others along, each a line of its own."""
    for other in [*dict.fromkeys(map(str, errors))][1:]:
        errors[0].add_note(other)
    return errors[0]
