"""A setting: a solver with all its parameters, and a key that is the same on every machine."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any

from assoc._parameters import Parameter, parameters_of
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.solvers import registry


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
