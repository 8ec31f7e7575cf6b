"""The values that a design may take for a parameter: a list, or a range to draw from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._parameters import Parameter
from assoc.errors import InvalidInputError


@dataclass(frozen=True)
class Values:
    """A list of values without duplicates."""

    values: tuple[Any, ...]

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a value."""
        return self.values[int(rng.integers(len(self.values)))]


@dataclass(frozen=True)
class Range:
    """Numbers from ``low`` to ``high``, both included."""

    low: float
    high: float
    logarithmic: bool = False
    """Whether equal ratios are equally likely, rather than equal differences."""
    whole: bool = False
    """Whether only whole numbers are drawn."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw a number."""
        if self.whole and not self.logarithmic:
            return int(rng.integers(int(self.low), int(self.high) + 1))
        share = float(rng.random())
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return round(value) if self.whole else value


Space = Values | Range


def read_text(parameter: Parameter, text: str, label: str) -> Space:
    """Read ``1,2,3`` or ``0.1:0.9`` or ``1:1000:log``."""
    parts = text.split(":")
    if parameter.kind in (int, float) and len(parts) in (2, 3):
        if len(parts) == 3 and parts[2] != "log":
            raise InvalidInputError(f"{label}: expected LOW:HIGH or LOW:HIGH:log, got {text!r}")
        low, high = (_parse(parameter, part, label) for part in parts[:2])
        return make_range(parameter, low, high, len(parts) == 3, label)
    words = [word.strip() for word in text.split(",")]
    if not any(words):
        raise InvalidInputError(f"{label}: no values given, expected {parameter.name}=VALUE[,VALUE...]")
    return values([_parse(parameter, word, label) for word in words])


def read_value(parameter: Parameter, value: Any, label: str) -> Space:
    """Read a value of a TOML file: one value, a list of them, or ``{low = .., high = .., log = true}``."""
    if isinstance(value, dict):
        unknown = sorted({*value} - {"low", "high", "log"})
        if unknown or not {"low", "high"} <= {*value} or parameter.kind not in (int, float):
            raise InvalidInputError(f"{label}: expected a value, a list or {{low, high, log}}, got {value!r}")
        low, high = (parameter.check(value[end], f"{label}.{end}") for end in ("low", "high"))
        return make_range(parameter, low, high, value.get("log", False) is True, label)
    if not isinstance(value, list):
        return Values((parameter.check(value, label),))
    if not value:
        raise InvalidInputError(f"{label}: the list is empty, expected at least one value")
    return values([parameter.check(item, label) for item in value])


def values(found: list[Any]) -> Values:
    """Return the values without duplicates, in the given order."""
    return Values(tuple(dict.fromkeys(found)))


def make_range(parameter: Parameter, low: float, high: float, logarithmic: bool, label: str) -> Range:
    """Check and return a range."""
    if parameter.kind is int and max(abs(low), abs(high)) >= 2**62:
        raise InvalidInputError(f"{label}: expected whole numbers within +-4e18, got a larger one")
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InvalidInputError(f"{label}: expected low < high, got {low}:{high}")
    if logarithmic and low <= 0:
        raise InvalidInputError(f"{label}: a logarithmic range needs low > 0, got {low}")
    return Range(low, high, logarithmic, parameter.kind is int)


def _parse(parameter: Parameter, text: str, label: str) -> Any:
    try:
        if parameter.kind is bool:
            return {"true": True, "false": False}[text.lower()]
        value = parameter.kind(text)
    except (ValueError, KeyError):
        expected = {int: "a whole number", float: "a number", bool: "true or false"}[parameter.kind]
        raise InvalidInputError(f"{label}: expected {expected}, got {text!r}") from None
    return parameter.check(value, label)
