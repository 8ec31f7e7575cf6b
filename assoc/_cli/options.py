"""Options of the command line, made from parameter dataclasses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from assoc._parameters import Option


def given(choices: Sequence[Option], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Values of those options that were given, in their types."""
    found = {}
    for option in choices:
        if option.name in arguments:
            value = arguments[option.name]
            found[option.name] = value if option.kind is bool else option.parse(value)
    return found
