"""Designs: the settings that a study runs, every combination of values; and the values or ranges that are searched.

A setting is a solver with all its parameters, and has a key that is the same on every machine.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from assoc._parameters import Parameter, parameters_of
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.solvers import registry

MOST_SETTINGS = 1_000_000
"""Largest number of settings of a design; more are taken for a typing error."""


@explains_wrong_types
@dataclass(frozen=True)
class Setting:
    """One solver and its parameters.

    Parameters
    ----------
    solver : str
        One of ``assoc.solvers.names()``.
    parameters : mapping
        Parameters that differ from the defaults; the others are filled in.

    Raises
    ------
    InvalidInputError
        Unknown solver or parameter (similar names are listed), or a value out of range.
    """

    solver: str
    parameters: Mapping[str, Any]

    def __post_init__(self) -> None:
        known = {option.name: option for option in parameters_of(registry.parameters(self.solver))}
        values = {
            name: known[name].check(value, f"{self.solver}.{name}") if name in known else value
            for name, value in self.parameters.items()
        }
        try:
            made: Any = registry.make_parameters(self.solver, values)
        except InvalidInputError as error:
            raise InvalidInputError(f"{self.solver}: {error}") from None
        object.__setattr__(
            self, "parameters", MappingProxyType({field.name: getattr(made, field.name) for field in fields(made)})
        )

    @cached_property
    def key(self) -> str:
        """Sixteen hexadecimal digits of the digest of solver and parameters."""
        text = json.dumps([self.solver, dict(self.parameters)], sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Setting) and self.key == other.key

    def __reduce__(self) -> Any:
        # a worker has to be sent users' solvers
        return _received, (registry.own([self.solver]), self.solver, dict(self.parameters))


def _received(solvers: tuple[registry.Own, ...], solver: str, parameters: Mapping[str, Any]) -> Setting:
    """Restore a setting in the process that it was sent to."""
    registry.restore(solvers)
    return Setting(solver, parameters)


def parameter(solver: str, name: str) -> Parameter:
    """Return a solver's parameter that text can give.

    Raises
    ------
    InvalidInputError
        The solver has no parameter of this name; similar names are listed.
    """
    for option in parameters_of(registry.parameters(solver)):
        if option.name == name:
            return option
    try:
        registry.make_parameters(solver, {name: None})
    except InvalidInputError as error:
        raise error from None
    raise InvalidInputError(f"{name}: cannot be given as text")


@dataclass(frozen=True)
class Range:
    """Numbers from ``low`` to ``high``, both included, for a search."""

    low: float
    high: float
    logarithmic: bool = False
    """Whether equal ratios are equally likely, rather than equal differences."""
    whole: bool = False
    """Whether only whole numbers are tried."""

    def __contains__(self, value: Any) -> bool:
        return self.low <= value <= self.high


Values = tuple[Any, ...]
Space = Values | Range
"""Values without duplicates, or a range."""


def read_text(parameter: Parameter, text: str, label: str) -> Space:
    """Read ``1,2,3`` or ``0.1:0.9`` or ``1:1000:log``."""
    parts = text.split(":")
    if parameter.kind in (int, float) and len(parts) in (2, 3):
        if len(parts) == 3 and parts[2] != "log":
            raise InvalidInputError(f"{label}: expected LOW:HIGH or LOW:HIGH:log, got {text!r}")
        low, high = (_parse(parameter, part, label) for part in parts[:2])
        if parameter.kind is int and max(abs(low), abs(high)) >= 2**62:
            raise InvalidInputError(f"{label}: expected whole numbers within +-4e18, got a larger one")
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InvalidInputError(f"{label}: expected low < high, got {low}:{high}")
        if len(parts) == 3 and low <= 0:
            raise InvalidInputError(f"{label}: a logarithmic range needs low > 0, got {low}")
        return Range(low, high, len(parts) == 3, parameter.kind is int)
    words = [word.strip() for word in text.split(",")]
    if not any(words):
        raise InvalidInputError(f"{label}: no values given, expected {parameter.name}=VALUE[,VALUE...]")
    return tuple(dict.fromkeys(_parse(parameter, word, label) for word in words))


def read_values(parameter: Parameter, value: Any, label: str) -> Values:
    """Read one value, or a list of them."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, (list, tuple, range)):
        return (parameter.check(value, label),)
    if not value:
        raise InvalidInputError(f"{label}: the list is empty, expected at least one value")
    return tuple(dict.fromkeys(parameter.check(item, label) for item in value))


def _parse(parameter: Parameter, text: str, label: str) -> Any:
    try:
        if parameter.kind is bool:
            return {"true": True, "false": False}[text.lower()]
        value = parameter.kind(text)
    except (ValueError, KeyError):
        expected = {int: "a whole number", float: "a number", bool: "true or false"}[parameter.kind]
        raise InvalidInputError(f"{label}: expected {expected}, got {text!r}") from None
    return parameter.check(value, label)


@explains_wrong_types
def grid(solver: str, space: Mapping[str, Any] | None = None) -> list[Setting]:
    """Every combination of the values of some parameters of a solver.

    Parameters
    ----------
    solver : str
        One of ``assoc.solvers.names()``.
    space : mapping of str to list
        Values of each parameter; the last one varies fastest. Empty: the solver's defaults.

    Returns
    -------
    list of Setting
        Without duplicates.

    Raises
    ------
    InvalidInputError
        Unknown solver or parameter, a value out of range, or a parameter without values.
    LimitExceededError
        More than a million settings.
    """
    values = {
        name: read_values(parameter(solver, name), value, f"{solver}.{name}") for name, value in (space or {}).items()
    }
    return combinations(solver, values, "grid")


def combinations(solver: str, spaces: Mapping[str, Space], label: str) -> list[Setting]:
    """Every combination of the values of a solver's parameters."""
    registry.parameters(solver)
    lists = []
    for name, space in spaces.items():
        if isinstance(space, Range):
            raise InvalidInputError(f"{label}: {solver}.{name} is a range, which only --tune takes; give values")
        lists.append(space)
    count = math.prod(map(len, lists))
    if count > MOST_SETTINGS:
        raise LimitExceededError(f"{label}: {count} settings, at most {MOST_SETTINGS}")
    made = (Setting(solver, dict(zip(spaces, chosen, strict=True))) for chosen in itertools.product(*lists))
    return list(dict.fromkeys(made))


def read_words(words: Sequence[str], solvers: Sequence[str], label: str = "--grid") -> dict[str, dict[str, Space]]:
    """Read ``name=values`` or ``solver.name=values`` for each of the solvers.

    A name without a solver applies to every solver with this parameter.
    """
    found: dict[str, dict[str, Space]] = {solver: {} for solver in solvers}
    for word in words:
        name, equals, text = word.partition("=")
        name = name.strip()
        if not equals or not name:
            raise InvalidInputError(f"{label}: expected NAME=VALUE[,VALUE...], got {word!r}")
        owner, dot, plain = name.rpartition(".")
        if dot and owner not in solvers:
            raise InvalidInputError(f"{label}: {name}: {owner!r} is no solver of the study: {', '.join(solvers)}")
        plain = plain.replace("-", "_")
        owners = _owners(plain, [owner] if dot else list(solvers), label)
        for solver in owners:
            if plain in found[solver]:
                raise InvalidInputError(f"{label}: {plain} is given twice for {solver}")
            found[solver][plain] = read_text(parameter(solver, plain), text, f"{label}: {name}")
    return found


def _owners(name: str, solvers: list[str], label: str) -> list[str]:
    owners, complaints = [], []
    for solver in solvers:
        try:
            parameter(solver, name)
            owners.append(solver)
        except InvalidInputError as error:
            complaints.append(str(error))
    if not owners:
        # prefer the error that suggests a similar name
        complaints.sort(key=lambda text: "did you mean" not in text)
        raise InvalidInputError(f"{label}: {complaints[0]}")
    return owners


def settings_of(tables: Mapping[str, Any], label: str) -> list[Setting]:
    """Settings of the tables of a TOML file: for each solver a table or a list of tables, each a grid."""
    found: list[Setting] = []
    try:
        for solver, given in tables.items():
            for table in given if isinstance(given, list) else [given]:
                if not isinstance(table, Mapping):
                    raise InvalidInputError(f"[{solver}]: expected a table of parameters, got {table!r}")
                found += grid(solver, {key.replace("-", "_"): value for key, value in table.items()})
    except (InvalidInputError, LimitExceededError) as error:
        raise type(error)(f"{label}{error}") from None
    return list(dict.fromkeys(found))
