"""How the programs start and end: their streams and signals, one-line errors, exit codes."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from assoc._cli.lines import HelpFormatter
from assoc._cli.signals import Interruption, exit_on_signals
from assoc._cli.warnings import warnings_as_lines
from assoc._text.near import did_you_mean
from assoc._text.plain import one_line
from assoc.errors import AssocError, InfeasibleError, InvalidInputError, LimitExceededError

DONE, BAD_INPUT, NOTHING_FEASIBLE, INTERRUPTED = 0, 2, 3, 130
"""Exit codes; the last one is the shell's own for Ctrl-C."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, and whose help fits the terminal."""

    def __init__(self, **options: Any) -> None:
        super().__init__(formatter_class=HelpFormatter, allow_abbrev=False, **options)
        self.elsewhere: Callable[[], Mapping[str, str]] = dict
        """Returns flags that this program knows but does not take here, each with whose they are."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; what is not known is said together with what is near."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}{self._hint(unknown[0])}")
        return parsed

    def flags(self) -> dict[str, tuple[str, ...]]:
        """Return all flags, each with the values that it takes where these are few."""
        return {flag: tuple(one.choices or ()) for flag, one in self._option_string_actions.items()}

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
        """Print one line to stderr and leave with exit code 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {one_line(message)} (see --help)\n")


def command(name: str) -> str:
    """How a user calls a program: as it was called now."""
    called = os.path.basename(sys.argv[0]).removesuffix(".exe") if sys.argv else ""
    return f"assoc {name}" if called == "assoc" else f"python -m assoc.{name}"


def run_program(program: Callable[[], None], name: str, interruption: Interruption | None = None) -> int:
    """Run a program and turn what it raises into one line on stderr and an exit code; which signal, knows the last."""
    try:
        with warnings_as_lines(name):
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
        signalled = interruption is not None and interruption.code
        print(interruption.line() if interruption and signalled else f"{name}: interrupted", file=sys.stderr)
        return signalled or INTERRUPTED
    except BrokenPipeError:
        # the reader of our output (head, less) has seen enough; keep Python from flushing into it again
        sys.stdout = None
        return DONE
    except OSError as error:
        # not handled elsewhere: a full disk behind stdout, for example
        print(f"{name}: error: {one_line(error.strerror or error)}", file=sys.stderr)
        sys.stdout = None
        return BAD_INPUT
    finally:
        # where an interrupt has passed through an exec, Python ends with its own code for that, until the next one
        exec("")
    return DONE


def write_all(*writers: Callable[[], None]) -> None:
    """Write several outputs, the others also if one cannot be written: no result must be lost with it.

    Raises
    ------
    InvalidInputError
        The first that was raised.
    """
    errors = []
    for write in writers:
        try:
            write()
        except InvalidInputError as error:
            errors.append(error)
    if errors:
        raise errors[0]


def prepare_process(name: str) -> None:
    """Make a process ready to run a program: its streams, and what happens on signals."""
    prepare_streams()
    exit_on_signals(name)


def prepare_streams() -> None:
    """Open the standard streams where they are closed, and let stdout and stderr print any name of a file."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # takes the lowest number that is free: no file of ours must get it, and be printed into
            os.open(os.devnull, os.O_RDWR)
    if sys.stdin is None:
        sys.stdin = open(0, closefd=False)
    if sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False)
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
