"""Options, declared once with flag, kind, help and scope; parsing, checks and errors follow from that."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from typing import Any, NoReturn

from assoc._cli.inputs import read_toml, with_others
from assoc._cli.lines import HelpFormatter
from assoc._cli.values import Kind, Output, density, probability, processes, seconds, text, whole
from assoc._files.output import STDOUT, check_writable, is_stream
from assoc._parameters import parameters_of
from assoc._system.imports import check_extra
from assoc._text.near import did_you_mean
from assoc._text.plain import one_line
from assoc._text.removed import removed
from assoc.errors import InvalidInputError

BAD_INPUT = 2
"""Exit code."""


def flag_of(name: str) -> str:
    """Return the flag of an option."""
    return "--" + name.replace("_", "-")


@dataclass(frozen=True)
class Option:
    """An option of a program."""

    name: str
    """With underscores for the dashes of its flag."""
    metavar: str
    """Placeholder for its value in the help; empty for an option without a value."""
    help: str
    kind: Kind = text
    only: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Scope: by the name of another option or choice, the values that this option is for."""
    rest: Mapping[str, Any] = field(default_factory=dict)
    """Further arguments for argparse."""
    short: str = ""
    positional: bool = False

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        """Add the option to a parser or a group of one."""
        rest: dict[str, Any] = {"default": None, **self.rest}
        flags = [self.name] if self.positional else [*filter(None, [self.short]), flag_of(self.name)]
        if self.metavar:
            rest["metavar"] = self.metavar
        elif "action" not in rest:
            rest |= {"action": "store_const", "const": True}
        parser.add_argument(*flags, help=self.help.replace("%", "%%"), **rest)

    def read(self, value: Any, label: str) -> Any:
        """Convert the text of a command line, or the list of texts, to the value."""
        if isinstance(value, list):
            return [self.kind(item, label) for item in value]
        return self.kind(value, label) if isinstance(value, str) else value

    def read_toml(self, value: Any, label: str) -> Any:
        """Convert a value of a TOML file to the option's."""
        many = "nargs" in self.rest
        values = value if many and isinstance(value, list) else [value]
        if self.kind is text and not all(isinstance(item, str) for item in values):
            raise InvalidInputError(f"{label}: expected text{' or a list of texts' if many else ''}, got {value!r}")
        found = [self.kind(str(item), label) for item in values]
        return found if many else found[0]


class Given(dict[str, Any]):
    """Values of options by name, None if not given; the words of the line, its outputs, and the TOML file it names."""

    def __init__(self, values: Mapping[str, Any], words: Sequence[str]) -> None:
        super().__init__(values)
        self.words, self.file = list(words), ""
        self.outputs: dict[str, Output] = {}
        self._of_file: set[str] = set()

    def some(self, names: Iterable[str]) -> dict[str, Any]:
        """Those of some values that were given."""
        return {name: self[name] for name in names if self.get(name) is not None}

    def label(self, name: str) -> str:
        """Name of an option in messages: its flag, or its key in the file."""
        return f"{self.file}: {name}" if name in self._of_file else flag_of(name)

    def of_line(self, name: str) -> bool:
        """Whether the option is on the command line."""
        return self[name] not in (None, []) and name not in self._of_file

    def fill(self, file: str, values: Mapping[str, Any]) -> None:
        """Take values from a file where the command line has none."""
        self.file = file
        missing = [name for name in values if self.get(name) in (None, [])]
        self._of_file.update(missing)
        self.update((name, values[name]) for name in missing)

    def check_outputs(
        self,
        inputs: Iterable[str | None],
        *,
        also: Iterable[str] = (),
        reserved: Iterable[str] = (),
        new_folder: str | None = None,
    ) -> None:
        """Refuse, before the work, outputs that cannot be written, or that would overwrite an input.

        `also` are further files to write, `reserved` others that must not be overwritten; the program will make
        `new_folder`.
        """
        read = [path for path in inputs if path]
        # said first: wrong names explain most other errors
        absent = [path for path in read if path != STDOUT and not os.path.lexists(path)]
        if absent:
            raise with_others([InvalidInputError(f"{path}: no such file") for path in absent])
        taken = {_real_path(path) for path in (*read, *reserved) if path}
        outputs = [*self.some(self.outputs).values(), *also]
        for path in outputs:
            if not path or is_stream(path):
                continue
            if _real_path(path) in taken:
                raise InvalidInputError(f"{path}: is given twice, or would overwrite an input file")
            taken.add(_real_path(path))
        for path in filter(None, outputs):
            check_writable(path, folder_to_come=new_folder)
        for name, value in self.some(self.outputs).items():
            self.outputs[name](value, flag_of(name))

    def check_use(self, options: Iterable[Option], **chosen: str) -> None:
        """Refuse options of the command line that do not apply to what was chosen."""
        for option in options:
            for what, allowed in option.only.items():
                if self.of_line(option.name) and chosen[what] not in allowed:
                    flag = f"{flag_of(what)} " if what in self else ""
                    expected = f"is only for {flag}{' or '.join(allowed)}, not for {chosen[what]}"
                    raise InvalidInputError(f"{flag_of(option.name)}: {expected}")


class Parser(argparse.ArgumentParser):
    """A parser of options: its errors are one line, and its help fits the terminal."""

    def __init__(self, **rest: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, allow_abbrev=False, **rest)
        self.declared: dict[str, Option] = {}
        self.elsewhere: Callable[[], Mapping[str, str]] = dict
        """Returns flags that do not apply to this program here, each with what it belongs to."""

    def declare(self, *options: Option, group: str = "") -> None:
        """Add options, to a group of the help if ``group`` is given."""
        into = self.add_argument_group(group) if group else self
        for option in options:
            option.add_to(into)
            self.declared[option.name] = option

    def read(self, words: Sequence[str]) -> Given:
        """Read a command line; a value that is invalid for its option is refused."""
        parsed = vars(self.parse_args(words))
        given = Given({}, words)
        for name, option in self.declared.items():
            if isinstance(option.kind, Output):
                given[name] = parsed[name]
                given.outputs[name] = option.kind
            else:
                given[name] = option.read(parsed[name], flag_of(name))
        return given

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; the error for an unknown flag says what to use instead, or suggests similar ones."""
        for word in sys.argv[1:] if args is None else args:
            flag = word.partition("=")[0]
            line = removed(flag) or removed(f"{self.prog} {flag}")
            if line and flag not in self._option_string_actions:
                self.error(line)
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._hint(unknown[0])}")
        return parsed

    def _hint(self, word: str) -> str:
        flag = word.partition("=")[0]
        if not flag.startswith("-"):
            return ""
        elsewhere = self.elsewhere()
        if flag in elsewhere:
            return f"; {flag} belongs to {elsewhere[flag]}"
        near = did_you_mean(flag, [*self._option_string_actions, *elsewhere])
        return f"; {near}" if near else ""

    def error(self, message: str) -> NoReturn:
        """Print one line to stderr and exit with code 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {one_line(message)} (see --help)\n")


def _real_path(path: str) -> str:
    try:
        return os.path.realpath(path)
    except ValueError:  # a NUL, which TOML can hold: reading or writing reports it
        return path


def read_config(
    path: str | None, options: Iterable[Option], solvers: Sequence[str]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read options, and tables of solvers' parameters, from a TOML file if one is given."""
    values: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    known = {option.name: option for option in options}
    for key, value in read_toml(path).items() if path else ():
        if key in known:
            values[key] = known[key].read_toml(value, f"{path}: {key}")
        elif key in solvers:
            tables[key] = value
        elif line := removed(flag_of(key)):
            raise InvalidInputError(f"{path}: {line}")
        elif isinstance(value, (dict, list)):
            raise InvalidInputError(f"{path}: [{key}] is no solver; known: {', '.join(solvers)}")
        else:
            raise InvalidInputError(f"{path}: {key}: unknown key; known: {', '.join(known)}, and tables [solver]")
    return values, tables


def parameter_options(owner: type) -> list[Option]:
    """Options for the fields of a parameter dataclass that text can give."""
    found = []
    for parameter in parameters_of(owner):
        more: dict[str, Any] = {}
        metavar = parameter.name.upper() if parameter.positional else {int: "N", float: "X"}.get(parameter.kind, "TEXT")
        if parameter.choices:
            metavar = "{" + ",".join(map(str, parameter.choices)) + "}"
        if parameter.kind is bool:
            metavar, more = "", {"action": argparse.BooleanOptionalAction}
        default = "" if parameter.default in (MISSING, None) else f" (default {parameter.default})"
        described = (parameter.help + default).strip()
        found.append(
            Option(parameter.name, metavar, described, parameter.parse, rest=more, positional=parameter.positional)
        )
    return found


def flags_of_solvers(but: str) -> dict[str, str]:
    """Flags of the parameters of all solvers except ``but``, with the solvers that have them."""
    from assoc.solvers import registry

    found: dict[str, list[str]] = {}
    for name in registry.names():
        for parameter in parameters_of(registry.parameters(name)):
            found.setdefault(flag_of(parameter.name), []).append(name)
    return {
        flag: f"{' and '.join(owners)} (--solver {owners[0]}), not to {but}"
        for flag, owners in found.items()
        if but not in owners
    }


def read_first(words: Sequence[str], *names: str) -> dict[str, str | None]:
    """Read some options before all others: those that decide which other options exist."""
    parser = Parser(add_help=False)
    parser.declare(*(Option(name, "NAME", "") for name in names))
    return vars(parser.parse_known_args(words)[0])


def check_scheduler(given: Given) -> None:
    """Refuse ``--scheduler`` beside ``--jobs``, or without dask."""
    if given["scheduler"]:
        if given["jobs"]:
            raise InvalidInputError("--jobs: a cluster has its own workers; give --jobs or --scheduler, not both")
        check_extra("distributed", "dask")


def verbosity(more: str) -> tuple[Option, Option]:
    """Return ``-q`` and ``-v``; ``more`` is what ``-v`` prints."""
    return (
        Option("quiet", "", "say nothing but errors and warnings", short="-q"),
        Option("verbose", "", f"say more: {more}", short="-v"),
    )


VERBOSITY_FLAGS = ("-q", "--quiet", "-v", "--verbose")

COMMON = {option.name: option for option in (
    Option("seed", "N", "seed of the random numbers (default 0)", whole(0)),
    Option("time_limit", "S",
           "seconds for the solver on each scan; it then returns the best solution found (default: none)", seconds),
    Option("gate_probability", "P", "probability that a gate contains a target's true measurement (default 0.999)",
           probability),
    Option("max_tuples", "N", "stop if a scan has more candidate tuples than this", whole(1)),
    Option("target_density", "D",
           "targets per m^3 (in the plane per m^2), or auto: positions integrated out (default: equation 5)", density),
    Option("jobs", "N", "number of processes, or 'all' for one per core (default 1)", processes),
    Option("scheduler", "ADDRESS", "run on a dask cluster: tcp://host:port"),
    Option("import", "MODULE", "import modules of your own first, which register solvers (docs/own_solver.md)"),
    Option("config", "FILE", "read these options from a TOML file; solver parameters in a table [solver]"),
)}  # fmt: skip
"""Options shared by several programs."""
