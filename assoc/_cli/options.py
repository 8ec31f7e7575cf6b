"""Options of the command line: those that several programs have, and those made from parameter dataclasses."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from assoc._cli.program import Parser
from assoc._cli.values import density, number, processes, seconds, whole_number

if TYPE_CHECKING:
    from assoc._parameters import Option


class CommonOption(NamedTuple):
    """An option that several programs have: what stands for its value in the help, how it is read, its help."""

    metavar: str
    parse: Callable[[str, str], Any]
    help: str


COMMON_OPTIONS = {
    "seed": CommonOption("N", partial(whole_number, least=0), "seed of the random numbers (default 0)"),
    "time_limit": CommonOption(
        "S", seconds, "seconds for the solver on each scan; it then returns the best solution found (default: none)"
    ),
    "gate_probability": CommonOption(
        "P", number, "probability that a gate contains a target's true measurement (default 0.999)"
    ),
    "max_tuples": CommonOption(
        "N", partial(whole_number, least=1), "stop if a scan has more candidate tuples than this"
    ),
    "target_density": CommonOption(
        "D", density, "targets per m^3 (in the plane per m^2), or auto: positions integrated out (default: equation 5)"
    ),
    "jobs": CommonOption("N", processes, "number of processes, or 'all' for one per core (default 1)"),
    "kbest": CommonOption("K", partial(whole_number, least=1), "the K best associations of each scan, in order"),
}
"""By name; the flag has dashes for underscores."""


def flag_of(name: str) -> str:
    """Return the flag of an option."""
    return "--" + name.replace("_", "-")


def add_common_options(parser: argparse._ActionsContainer, names: Iterable[str]) -> None:
    """Add options of `COMMON_OPTIONS` to a parser."""
    for name in names:
        option = COMMON_OPTIONS[name]
        parser.add_argument(flag_of(name), metavar=option.metavar, help=option.help)


def common_values(parsed: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the common options that were given, in their types."""
    return {
        name: option.parse(parsed[name], flag_of(name))
        for name, option in COMMON_OPTIONS.items()
        if parsed.get(name) is not None
    }


def parameter_values(choices: Sequence[Option], parsed: Mapping[str, Any]) -> dict[str, Any]:
    """Values of those parameters that were given, in their types."""
    found = {}
    for option in choices:
        if option.name in parsed:
            value = parsed[option.name]
            found[option.name] = value if option.kind is bool else option.parse(value)
    return found


def flags_of_solvers(but: str) -> dict[str, str]:
    """Flags of the parameters of all solvers but one, with whose they are."""
    from assoc._parameters import options
    from assoc.solvers import registry

    found: dict[str, list[str]] = {}
    for name in registry.names():
        for option in options(registry.parameters(name)):
            found.setdefault(option.flag, []).append(name)
    return {
        flag: f"{' and '.join(owners)} (--solver {owners[0]}), not to {but}"
        for flag, owners in found.items()
        if but not in owners
    }


def read_first(program: str, words: Sequence[str], names: Iterable[str]) -> dict[str, str | None]:
    """Read some options before all others: those that decide which others there are."""
    parser = Parser(prog=program, add_help=False)
    for name in names:
        parser.add_argument(flag_of(name))
    return vars(parser.parse_known_args(words)[0])
