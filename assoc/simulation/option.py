"""Options of scenarios."""

from __future__ import annotations

from dataclasses import field
from typing import Any


def option(default: Any, help: str) -> Any:
    """Field of a parameter dataclass, with the text that command lines show."""
    return field(default=default, metadata={"help": help})
