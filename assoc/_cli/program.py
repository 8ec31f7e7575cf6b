"""How the programs start and end: their streams and signals, one-line errors, exit codes."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from assoc._cli.messages import warnings_as_lines
from assoc._cli.options import BAD_INPUT
from assoc._cli.signals import Interruption
from assoc._text.plain import one_line
from assoc.errors import AssocError, InfeasibleError, InvalidInputError, LimitExceededError

DONE, NOTHING_FEASIBLE, INTERRUPTED = 0, 3, 130
"""Exit codes; the last one is the shell's own for Ctrl-C."""


@dataclass(frozen=True)
class Program:
    """A program.

    Attributes
    ----------
    name : str
        What its messages begin with.
    run : callable
        Does the work that the command line asks for.
    listen : callable
        Says what signals do, in a process of its own.
    interruption : Interruption, optional
        Knows which signal ended it.
    """

    name: str
    run: Callable[[list[str]], None]
    listen: Callable[[], object]
    interruption: Interruption | None = None

    def start(self, arguments: Sequence[str] | None = None) -> int:
        """Run the program as a process of its own; returns its exit code."""
        prepare_streams()
        self.listen()
        return self.main(arguments)

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run the program in this process; returns its exit code."""
        words = list(sys.argv[1:] if arguments is None else arguments)
        return run_program(lambda: self.run(words), self.name, self.interruption)


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


def write_all(*outputs: tuple[object, Callable[[], object]]) -> None:
    """Write those outputs that are asked for, the others also if one cannot be written: no result is lost with it.

    Parameters
    ----------
    *outputs : (object, callable)
        The name of the file or another value, None if it is not asked for; what writes it.

    Raises
    ------
    InvalidInputError
        The first that was raised.
    """
    errors = []
    for asked, write in outputs:
        try:
            if asked is not None:
                write()
        except InvalidInputError as error:
            errors.append(error)
    if errors:
        raise errors[0]


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
