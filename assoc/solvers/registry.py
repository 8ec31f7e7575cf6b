"""Names of the solvers and where to find them, by convention and without importing them all.

Solver ``name`` is the folder ``assoc/solvers/name``. Its ``parameters.py`` has the dataclass ``NameParameters`` and
imports no compiler, so that ``--help`` is quick; its ``solve.py`` has the function ``solve``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

from assoc._parameters import Parameters
from assoc._system.compile_time import loading
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.near import did_you_mean
from assoc._text.removed import removed
from assoc.errors import InvalidInputError
from assoc.packing.run import SolveFunction

_NAMES = ("greedy", "aco", "genetic", "tabu", "lagrangian", "exact", "milp")
# solvers that users added by `register`
_REGISTERED: dict[str, tuple[type[Parameters], SolveFunction]] = {}

Own = tuple[str, type[Parameters], SolveFunction]
"""Name, parameters and function of a user's solver."""


@explains_wrong_types
def names() -> list[str]:
    """Names of all solvers, the package's first."""
    return [*_NAMES, *_REGISTERED]


@explains_wrong_types
def register(name: str, parameters: type[Parameters], solve: SolveFunction) -> None:
    """Add a solver of your own under a new name.

    Parameters
    ----------
    name : str
        The name for ``assign(problem, name)``.
    parameters : type
        Frozen dataclass with a default for every field, child of ``Parameters``.
    solve : callable
        ``solve(packing, parameters, run) -> Outcome``.

    Raises
    ------
    InvalidInputError
        The name is taken, or an argument is not as described.
    """
    if not isinstance(name, str) or not name:
        raise InvalidInputError(f"name: expected text, got {name!r}")
    if not (isinstance(parameters, type) and issubclass(parameters, Parameters) and is_dataclass(parameters)):
        raise InvalidInputError(f"parameters: expected a dataclass, child of Parameters, got {parameters!r:.80}")
    if not callable(solve):
        raise InvalidInputError(f"solve: expected a function, got {type(solve).__name__}")
    if name in names():
        raise InvalidInputError(f"solver: the name {name!r} is taken")
    _REGISTERED[name] = (parameters, solve)


def own(names: Iterable[str]) -> tuple[Own, ...]:
    """Return the solvers that `register` added, so that other processes can `restore` them."""
    return tuple((name, *_REGISTERED[name]) for name in dict.fromkeys(names) if name in _REGISTERED)


def restore(solvers: Iterable[Own]) -> None:
    """Register the result of `own` from another process; importing its module may have registered them already."""
    for name, kind, solve in solvers:
        _REGISTERED.setdefault(name, (kind, solve))


@explains_wrong_types
def parameters(name: str) -> type[Parameters]:
    """Return the parameter dataclass of a solver; its fields' metadata have a "help" text.

    Raises
    ------
    InvalidInputError
        There is no solver with this name.
    """
    if name in _REGISTERED:
        return _REGISTERED[name][0]
    return _kind(name)


def solver(name: str) -> SolveFunction:
    """Return the solve function of a solver; users' solvers are guarded (own_solver.py).

    Raises
    ------
    InvalidInputError
        There is no solver with this name.
    """
    if name in _REGISTERED:
        from assoc.solvers.own_solver import guarded  # loads a compiler

        return guarded(name, _REGISTERED[name][1])
    return _module(name, "solve").solve


def make_parameters(name: str, values: Mapping[str, Any]) -> Parameters:
    """Check and complete a solver's parameters; of an unknown name the message lists similar ones."""
    if not values and name not in _REGISTERED:
        return _defaults(name)
    kind = parameters(name)
    known = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    for key in values:
        if key not in known:
            # associate and assign hand on what they do not know
            lines = (removed(f"{owner}({key})") for owner in (name, "associate", "assign"))
            raise InvalidInputError(
                next(filter(None, lines), "") or f"{key}: no parameter of solver {name!r}; {_near(key, known)}"
            )
    try:
        return kind(**values)
    except TypeError as error:
        raise InvalidInputError(f"parameters of solver {name!r}: {error}") from None


@cache
def _defaults(name: str) -> Parameters:
    return _kind(name)()


@cache
def _kind(name: str) -> type[Parameters]:
    return getattr(_module(name, "parameters"), f"{name.capitalize()}Parameters")


@cache
def _module(name: str, part: str) -> ModuleType:
    if name not in _NAMES:
        raise InvalidInputError(f"solver: unknown name {name!r}; {_near(name, names())}")
    with loading():
        return import_module(f"assoc.solvers.{name}.{part}")


def _near(name: object, known: list[str]) -> str:
    return did_you_mean(name, known) or ("known: " + ", ".join(known) if known else "it takes none")
