"""What the programs share: options made from parameter dataclasses, one-line errors, exit codes."""

from __future__ import annotations

import argparse
import io
import multiprocessing
import os
import signal
import sys
import threading
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from typing import Any, Literal, NoReturn, Union, cast, get_args, get_origin, get_type_hints

from assoc._system import temporary
from assoc.errors import AssocError, InfeasibleError, InvalidInputError, LimitExceededError

DONE, BAD_INPUT, NOTHING_FEASIBLE, INTERRUPTED = 0, 2, 3, 130
"""Exit codes; the last one is the shell's own for Ctrl-C."""


class Parser(argparse.ArgumentParser):
    """An argument parser that complains in one line."""

    def error(self, message: str) -> NoReturn:
        """Print one line to stderr and leave with exit code 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {one_line(message)} (see --help)\n")


def one_line(message: object) -> str:
    """Return a message with its line breaks taken out, and nothing in it that a terminal would obey."""
    return printable(" ".join(str(message).split()))


def printable(text: str) -> str:
    """Return text on one line that shows as it is; the names of files may hold anything."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


def run(program: Callable[[], None], name: str) -> int:
    """Run a program and turn what it raises into one line on stderr and an exit code."""
    try:
        program()
        sys.stdout.flush()
    except (InfeasibleError, LimitExceededError) as error:
        print(f"{name}: {one_line(error)}", file=sys.stderr)
        return NOTHING_FEASIBLE
    except AssocError as error:
        print(f"{name}: error: {one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError:
        print(f"{name}: out of memory", file=sys.stderr)
        return NOTHING_FEASIBLE
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # the reader of our output (head, less) has seen enough; keep Python from flushing into it again
        sys.stdout = None
        return DONE
    except OSError as error:
        # what the rooms do not expect: a full disk behind stdout, say
        print(f"{name}: error: {one_line(error.strerror or error)}", file=sys.stderr)
        sys.stdout = None
        return BAD_INPUT
    return DONE


def each(*outputs: Callable[[], None]) -> None:
    """Do every one of several outputs, also if one cannot be written: what was worked out must not be lost with it.

    Raises
    ------
    InvalidInputError
        The first that was raised.
    """
    complaints = []
    for output in outputs:
        try:
            output()
        except InvalidInputError as error:
            complaints.append(error)
    if complaints:
        raise complaints[0]


def begin(name: str) -> None:
    """Make a process ready to run a program: its streams, and what happens on signals."""
    steady_streams()
    leave_on_signals(name)


def steady_streams() -> None:
    """Give stdout and stderr somewhere to go where they are closed, and a way to print any name of a file."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # takes the lowest number that is free: no file of ours must get it, and be printed into
            os.open(os.devnull, os.O_RDWR)
    if sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False)
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def ending_signals() -> dict[int, str]:
    """Signals that end a program, with what is said of them; not those that it was started to ignore (nohup)."""
    words = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
    if not hasattr(signal, "pthread_sigmask"):
        return {}
    numbers = {getattr(signal, name): text for name, text in words.items()}
    return {number: text for number, text in numbers.items() if signal.getsignal(number) is not signal.SIG_IGN}


def leave_on_signals(name: str) -> None:
    """Let Ctrl-C and its kin end the program at once, with one line, also while a library solves without Python.

    A Python handler would run only when the library returns, which can take minutes, and some MIP solvers
    put a handler of their own in its place. So the signals are blocked, and a thread waits for them. The exit
    code is the shell's own: 128 and the number of the signal.
    """
    ending = ending_signals()
    if not ending:
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)

    def leave(number: int, frame: object = None) -> None:
        for child in multiprocessing.active_children():
            child.kill()
        temporary.end(128 + number, f"{name}: {ending[number]}\n")

    def watch() -> None:
        leave(signal.sigwait(ending))

    for number in ending:
        # where a library lets one through
        signal.signal(number, leave)

    threading.Thread(target=watch, name="signals", daemon=True).start()


class Option:
    """One parameter as an option of the command line or a key of a configuration file.

    Parameters
    ----------
    owner : type
        A parameter dataclass; its fields may carry metadata "help".
    field : dataclasses.Field
        The field of it.
    """

    def __init__(self, owner: type, field: Field[Any]) -> None:
        self.name = field.name
        self.flag = "--" + field.name.replace("_", "-")
        self.help = str(field.metadata.get("help", ""))
        self.default = field.default
        self.positional = bool(field.metadata.get("positional", False))
        self.choices: tuple[Any, ...] = ()
        self.optional = False
        self.kind: Any = get_type_hints(owner)[field.name]
        if get_origin(self.kind) in (Union, types.UnionType):
            self.optional = type(None) in get_args(self.kind)
            kinds = [kind for kind in get_args(self.kind) if kind is not type(None)]
            # "int | float" reads as a float; other unions are no option
            self.kind = kinds[0] if len(kinds) == 1 else float if {*kinds} == {int, float} else object
        if get_origin(self.kind) is Literal:
            self.choices = get_args(self.kind)
            self.kind = type(self.choices[0])

    @property
    def usable(self) -> bool:
        """Whether text on a command line can give its value."""
        return self.kind in (int, float, str, bool)

    def describe(self) -> str:
        """Return the text of the help, with the default."""
        if self.default is MISSING or self.default is None:
            return self.help
        return f"{self.help} (default {self.default})".strip()

    def metavar(self) -> str:
        """Return what stands for the value in the help."""
        if self.choices:
            return "{" + ",".join(map(str, self.choices)) + "}"
        return {int: "N", float: "X"}.get(self.kind, "TEXT")

    def parse(self, text: str) -> Any:
        """Turn text from the command line into the value."""
        try:
            value = self.kind(text)
        except ValueError:
            expected = {int: "a whole number", float: "a number"}.get(self.kind, "a value")
            raise InvalidInputError(f"{self.flag}: expected {expected}, got {text!r}") from None
        return self.check(value, self.flag)

    def check(self, value: Any, label: str) -> Any:
        """Check the type of a value from a configuration file; whole numbers will do for numbers."""
        if value is None and self.optional:
            return None
        if self.kind is float and isinstance(value, int) and not isinstance(value, bool):
            return float(value)
        if type(value) is not self.kind:
            expected = {int: "a whole number", float: "a number", bool: "true or false"}.get(
                self.kind, "text"
            )
            raise InvalidInputError(f"{label}: expected {expected}, got {value!r}")
        if self.choices and value not in self.choices:
            raise InvalidInputError(
                f"{label}: expected one of {', '.join(map(str, self.choices))}, got {value!r}"
            )
        return value

    def add_to(self, parser: argparse._ActionsContainer, *, hidden: bool = False) -> None:
        """Add the option to a parser or a group; without a value it stays out of the parsed arguments."""
        text = argparse.SUPPRESS if hidden else self.describe().replace("%", "%%")
        if self.positional:
            parser.add_argument(self.name, metavar=self.name.upper(), help=text)
        elif self.kind is bool:
            parser.add_argument(
                self.flag,
                dest=self.name,
                action=argparse.BooleanOptionalAction,
                default=argparse.SUPPRESS,
                help=text,
            )
        else:
            parser.add_argument(
                self.flag, dest=self.name, metavar=self.metavar(), default=argparse.SUPPRESS, help=text
            )


def options(owner: type) -> list[Option]:
    """Options for the fields of a parameter dataclass that text can give."""
    every = [Option(owner, field) for field in fields(cast(Any, owner))]
    return [option for option in every if option.usable]


def given(choices: Sequence[Option], arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Values of those options that were given, in their types."""
    found = {}
    for option in choices:
        if option.name in arguments:
            value = arguments[option.name]
            found[option.name] = value if option.kind is bool else option.parse(value)
    return found


def whole_number(text: str, label: str, least: int) -> int:
    """Parse a whole number of at least ``least``."""
    try:
        value = int(text)
    except ValueError:
        value = least - 1
    if value < least:
        raise InvalidInputError(f"{label}: expected a whole number >= {least}, got {text!r}")
    return value


def seconds(text: str, label: str) -> float:
    """Parse a number of seconds above 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise InvalidInputError(f"{label}: expected seconds > 0, got {text!r}")
    return value
