"""Designs: the settings that a study runs. A grid takes every combination, a random design draws some."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._parameters import Parameter, whole_seed
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.solvers import registry
from assoc.sweeps.setting import Setting, parameter


@dataclass(frozen=True)
class Values:
    """A list of values without duplicates."""

    values: tuple[Any, ...]

    @property
    def single(self) -> bool:
        """Whether there is nothing to choose."""
        return len(self.values) == 1

    def __contains__(self, value: object) -> bool:
        return value in self.values

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

    single = False

    def __contains__(self, value: Any) -> bool:
        return self.low <= value <= self.high

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


MOST_SETTINGS = 1_000_000
"""Largest number of settings of a design; more are taken for a typing error."""


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
    return _combinations(solver, _spaces(solver, space or {}), "grid", "assoc.sweeps.random_settings")


@explains_wrong_types
def random_settings(solver: str, space: Mapping[str, Any], count: int, seed: int | None = 0) -> list[Setting]:
    """Draw settings at random; the first n of a longer design are the design of length n.

    Parameters
    ----------
    solver : str
    space : mapping
        For each parameter a list of values or ``{"low": .., "high": .., "log": True}``.
    count : int
        Number of settings to draw.
    seed : int or None, default 0
        None: a random seed.

    Returns
    -------
    list of Setting
        At most ``count``, without duplicates.
    """
    return _drawn(solver, _spaces(solver, space), count, whole_seed(seed), "count")


def _spaces(solver: str, space: Mapping[str, Any]) -> dict[str, Space]:
    return {
        name: read_value(parameter(solver, name), _plain(value), f"{solver}.{name}") for name, value in space.items()
    }


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, (tuple, range)) else value


def _combinations(solver: str, spaces: Mapping[str, Space], label: str, drawn_by: str) -> list[Setting]:
    registry.parameters(solver)
    lists = []
    for name, space in spaces.items():
        if isinstance(space, Range):
            raise InvalidInputError(
                f"{label}: {solver}.{name} is a range, which only a random design takes ({drawn_by}); give values"
            )
        lists.append(space.values)
    count = math.prod(map(len, lists))
    if count > MOST_SETTINGS:
        raise LimitExceededError(f"{label}: {count} settings, at most {MOST_SETTINGS}; a random design can be smaller")
    made = (Setting(solver, dict(zip(spaces, chosen, strict=True))) for chosen in itertools.product(*lists))
    return list(dict.fromkeys(made))


def _drawn(solver: str, spaces: Mapping[str, Space], count: int, seed: int, label: str) -> list[Setting]:
    if not spaces:
        raise InvalidInputError(f"space: no parameter of {solver} to draw; give values or a range")
    if count > MOST_SETTINGS:
        raise LimitExceededError(f"{label}: {count} settings, at most {MOST_SETTINGS}")
    made = []
    for number in range(count):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        made.append(Setting(solver, {name: space.draw(rng) for name, space in spaces.items()}))
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


@explains_wrong_types
def settings_from(
    tables: Mapping[str, Any], random: int | None = None, seed: int = 0, label: str = ""
) -> list[Setting]:
    """Settings of a study described by tables, as a TOML file holds them.

    Parameters
    ----------
    tables : mapping
        For each solver a table or a list of tables: parameter to a value, a list of values, or
        ``{low, high, log}`` (drawn, with ``random``).
    random : int, optional
        Number of settings to draw from each table with a list or a range; by default every combination is taken.
    seed : int, default 0
    label : str
        Prefix of errors.
    """
    try:
        designs = [
            (solver, _spaces(solver, _table(solver, table)))
            for solver, given in tables.items()
            for table in (given if isinstance(given, list) else [given])
        ]
        return designed(designs, random, seed, "random", "random")
    except (InvalidInputError, LimitExceededError) as error:
        raise type(error)(f"{label}{error}") from None


def _table(solver: str, given: object) -> dict[str, Any]:
    if not isinstance(given, Mapping):
        raise InvalidInputError(f"[{solver}]: expected a table of parameters, got {given!r}")
    return {key.replace("-", "_"): value for key, value in given.items()}


def _is_open(spaces: Mapping[str, Space]) -> bool:
    """Whether there is something to draw: a range, or several values."""
    return any(isinstance(space, Range) or len(space.values) > 1 for space in spaces.values())


def designed(
    designs: Sequence[tuple[str, Mapping[str, Space]]],
    random: int | None,
    seed: int,
    label: str = "--grid",
    drawn_by: str = "--random",
) -> list[Setting]:
    """Settings of several solvers without duplicates: every combination, or ``random`` drawn ones of each design."""
    found: list[Setting] = []
    for solver, spaces in designs:
        if random is not None and _is_open(spaces):
            found += _drawn(solver, spaces, random, seed, drawn_by)
        else:
            found += _combinations(solver, spaces, label, f"{drawn_by}=N")
    if random is not None and designs and not any(_is_open(spaces) for _, spaces in designs):
        raise InvalidInputError(f"{label}: nothing to draw; give lists of values or ranges")
    return list(dict.fromkeys(found))
