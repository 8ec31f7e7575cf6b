"""Parameter dataclasses: how they are checked, and how they are read from text."""

from __future__ import annotations

import math
import secrets
import sys
import types
from dataclasses import Field, field, fields
from functools import cache
from numbers import Integral, Real
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

from assoc.errors import InvalidInputError

# seconds, about thirty years
_FOREVER = 1e9


class Parameter:
    """A parameter, given as text on a command line or as a value in a configuration file.

    Parameters
    ----------
    owner : type
        A parameter dataclass; its fields may carry metadata "help".
    field : dataclasses.Field
        The field of this dataclass.
    """

    def __init__(self, owner: type, field: Field[Any]) -> None:
        self.name = field.name
        self.help = str(field.metadata.get("help", ""))
        self.default = field.default
        self.positional = bool(field.metadata.get("positional", False))
        self.choices: tuple[Any, ...] = ()
        self.optional = False
        self.kind: Any = get_type_hints(owner)[field.name]
        if get_origin(self.kind) in (Union, types.UnionType):
            self.optional = type(None) in get_args(self.kind)
            kinds = [kind for kind in get_args(self.kind) if kind is not type(None)]
            # "int | float" reads as a float; other unions are not options
            self.kind = kinds[0] if len(kinds) == 1 else float if {*kinds} == {int, float} else object
        if get_origin(self.kind) is Literal:
            self.choices = get_args(self.kind)
            self.kind = type(self.choices[0])

    @property
    def usable(self) -> bool:
        """Whether text on a command line can give its value."""
        return self.kind in (int, float, str, bool)

    def parse(self, text: str, label: str) -> Any:
        """Convert text of a command line to the value."""
        try:
            value = self.kind(text)
        except ValueError:
            expected = {int: "a whole number", float: "a number"}.get(self.kind, "a value")
            raise InvalidInputError(f"{label}: expected {expected}, got {text!r}") from None
        return self.check(value, label)

    def check(self, value: Any, label: str) -> Any:
        """Check the type of a value from a configuration file; whole numbers are accepted as floats."""
        if value is None and self.optional:
            return None
        if self.kind is float and isinstance(value, int) and not isinstance(value, bool):
            if abs(value) > sys.float_info.max:
                raise InvalidInputError(f"{label}: expected a number within +-1.8e308, got a larger one")
            return float(value)
        if type(value) is not self.kind:
            expected = {int: "a whole number", float: "a number", bool: "true or false"}.get(self.kind, "text")
            raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")
        if self.choices and value not in self.choices:
            raise InvalidInputError(f"{label}: expected one of {', '.join(map(str, self.choices))}, got {value!r}")
        return value


def described(default: Any, text: str) -> Any:
    """A field of a parameter dataclass: its default, and what the programs and the documentation say of it."""
    return field(default=default, metadata={"help": text})


def parameters_of(owner: type) -> list[Parameter]:
    """The fields of a parameter dataclass that text can give."""
    every = [Parameter(owner, field) for field in fields(cast(Any, owner))]
    return [parameter for parameter in every if parameter.usable]


def is_whole(value: object, least: float = -math.inf, most: float = math.inf) -> bool:
    """Whether a value is a whole number in this range; True and False are not."""
    if type(value) is int:  # ten times quicker than the check for any whole number
        return least <= value <= most
    return isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most


def is_number(value: object, least: float = -math.inf, most: float = math.inf) -> bool:
    """Whether a value is a finite number in this range; True and False are not."""
    if type(value) is float:
        return math.isfinite(value) and least <= value <= most
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        number = float(value)
    except OverflowError:
        return False
    return math.isfinite(number) and least <= number <= most


def positive(value: object, what: str, *, zero: bool = False) -> float:
    """Return a finite number above 0 (or at least 0) as a float."""
    if not is_number(value, 0.0) or (not zero and value == 0):
        raise InvalidInputError(f"{what} must be a number {'>= 0' if zero else 'above 0'}, got {value!r}")
    return float(value)  # type: ignore[arg-type]


def whole_seed(seed: object) -> int:
    """Return a seed, a whole number >= 0, as an int; for None a random one."""
    if seed is None:
        return secrets.randbits(63)
    if not is_whole(seed, 0):
        raise InvalidInputError(f"seed: expected a whole number >= 0, or None for a random one, got {seed!r}")
    return int(seed)  # type: ignore[call-overload]


def checked_time_limit(time_limit: object, name: str = "time_limit") -> float | None:
    """Return a time limit as a float, or None; refuse anything but seconds above 0."""
    if time_limit is None:
        return None
    limit: Any = time_limit
    if isinstance(limit, Real) and not isinstance(limit, bool) and limit > 0:  # type: ignore[operator]
        # clocks of libraries end before that
        return float(limit) if limit <= _FOREVER else math.inf
    raise InvalidInputError(f"{name}: expected seconds > 0, got {time_limit!r}")


class Parameters:
    """Base of the parameter dataclasses, with their checks."""

    __slots__ = ()

    def memory(self, num_columns: int, num_rows: int) -> tuple[float, str, str] | None:
        """Estimate the memory that a solver takes with these parameters, in addition to the problem.

        Parameters
        ----------
        num_columns, num_rows : int
            Size of the packing: candidate tuples and measurements.

        Returns
        -------
        (float, str, str) or None
            Bytes, what takes them, and how to take fewer; None: next to nothing.
        """
        return None

    @property
    def every_tuple(self) -> bool:
        """Whether the solver is to see tuples, too, that cost no less than their singletons."""
        return False

    def _require(self, condition: bool, name: str, expected: str) -> None:
        if not condition:
            raise InvalidInputError(f"{name}: expected {expected}, got {getattr(self, name)!r}")

    def _whole(self, *names: str, least: int = 1, most: int | None = None) -> None:
        """Refuse fields that are not whole numbers of at least ``least``, or from least to most."""
        limit = math.inf if most is None else most
        for name in names:
            if not is_whole(getattr(self, name), least, limit):
                expected = f"a whole number >= {least}" if most is None else f"a whole number from {least} to {most}"
                self._require(False, name, expected)

    def _number(
        self, *names: str, above: float = -math.inf, least: float = -math.inf, most: float | None = None
    ) -> None:
        """Refuse fields that are not finite numbers above a limit, at least a limit, or from least to most."""
        if most is not None:
            expected = f"a number from {least:g} to {most:g}"
        else:
            expected = f"a number above {above:g}" if above > -math.inf else f"a number, at least {least:g}"
        for name in names:
            value = getattr(self, name)
            good = is_number(value, least, math.inf if most is None else most) and value > above
            self._require(good, name, expected)

    def _probability(self, *names: str) -> None:
        """Refuse fields that are not strictly between 0 and 1."""
        for name in names:
            value = getattr(self, name)
            self._require(is_number(value) and 0 < value < 1, name, "a number strictly between 0 and 1")


def values_of(parameters: Any) -> dict[str, Any]:
    """Names and values of a solver's parameters."""
    return {name: getattr(parameters, name) for name in _names_of(parameters.__class__)}


@cache
def _names_of(kind: type[Any]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))
