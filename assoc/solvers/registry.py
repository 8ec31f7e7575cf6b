"""The names of the solvers, their parameters, and where to find them without importing them all."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any

from assoc._parameters import Parameters
from assoc.errors import InvalidInputError
from assoc.packing.run import SolveFunction

# name -> module with a class `parameters` and a function `solve`; imported on first use
_MODULES: dict[str, str] = {
    name: f"assoc.solvers.{name}.solve" for name in ("greedy", "aco", "genetic", "tabu", "lagrangian", "exact", "milp")
}
_REGISTERED: dict[str, tuple[type[Parameters], SolveFunction]] = {}


def names() -> list[str]:
    """Names of all solvers, the package's own first."""
    return [*_MODULES, *(name for name in _REGISTERED if name not in _MODULES)]


def register(name: str, parameters: type[Parameters], solve: SolveFunction) -> None:
    """Add a solver of your own under a new name.

    Parameters
    ----------
    name : str
        What ``assign(problem, name)`` will call it.
    parameters : type
        Frozen dataclass with a default for every field, child of ``Parameters``.
    solve : callable
        ``solve(packing, parameters, run) -> Outcome``.

    Raises
    ------
    InvalidInputError
        The name is taken.
    """
    if name in _MODULES or name in _REGISTERED:
        raise InvalidInputError(f"solver: the name {name!r} is taken")
    _REGISTERED[name] = (parameters, solve)


def parameters(name: str) -> type[Parameters]:
    """Return the parameter dataclass of a solver; its fields' metadata have a "help" text.

    Raises
    ------
    InvalidInputError
        There is no solver of that name.
    """
    return _entry(name)[0]


def solver(name: str) -> SolveFunction:
    """Return the solve function of a solver.

    Raises
    ------
    InvalidInputError
        There is no solver of that name.
    """
    return _entry(name)[1]


def make_parameters(name: str, values: Mapping[str, Any]) -> Parameters:
    """Check and complete a solver's parameters.

    Raises
    ------
    InvalidInputError
        Unknown solver or parameter (the near names are listed), or a value out of range.
    """
    kind = parameters(name)
    known = [f.name for f in fields(kind)] if values else []  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            raise InvalidInputError(f"{key}: no parameter of solver {name!r}; {_near(key, known)}")
    try:
        return kind(**values)
    except TypeError as error:
        raise InvalidInputError(f"parameters of solver {name!r}: {error}") from None


def _entry(name: str) -> tuple[type[Parameters], SolveFunction]:
    if name in _REGISTERED:
        return _REGISTERED[name]
    if name not in _MODULES:
        raise InvalidInputError(f"solver: unknown name {name!r}; {_near(name, names())}")
    module = import_module(_MODULES[name])
    return module.parameters, module.solve


def _near(name: object, known: list[str]) -> str:
    close = difflib.get_close_matches(str(name), known, n=3)
    if close:
        return "did you mean " + " or ".join(close) + "?"
    return "known: " + ", ".join(known) if known else "it takes none"
