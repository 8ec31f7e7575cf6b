"""Start and end of the programs: streams and signals, one-line errors, exit codes."""

from __future__ import annotations

import io
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from assoc._cli.messages import warnings_as_lines
from assoc._cli.options import BAD_INPUT
from assoc._cli.signals import Interruption, end_early
from assoc._text.plain import one_line
from assoc.errors import AssocError, InfeasibleError, LimitExceededError

DONE, NOTHING_FEASIBLE, INTERRUPTED = 0, 3, 130
"""Exit codes; the last one is that of shells for Ctrl-C."""

_MAY_BE_MISSING = ("ortools", "pandas")
"""Dependencies that an installation may be without (docs/dependencies.md)."""


@dataclass(frozen=True)
class Program:
    """A program: its name in messages, what it does, and what signals do where it is the whole process."""

    name: str
    run: Callable[[list[str]], None]
    listen: Callable[[], object]
    interruption: Interruption | None = None
    """Records which signal ended it."""

    def start(self, arguments: Sequence[str] | None = None) -> int:
        """Run the program as the whole process; returns its exit code."""
        prepare_streams()
        if not sys.warnoptions:
            # of numpy, on infinities and the like: what matters is told by lines of our own
            warnings.simplefilter("ignore", RuntimeWarning)
        try:
            self.listen()
            code = self.main(arguments)
        except KeyboardInterrupt:
            # it came just before the work began, or just after it ended
            ended = self.interruption or Interruption(self.name)
            end_early(ended.code or INTERRUPTED, f"{ended.line()}\n")
        if code == INTERRUPTED or (self.interruption is not None and self.interruption.code):
            end_early(code)
        return code

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Run the program in this process; returns its exit code."""
        words = list(sys.argv[1:] if arguments is None else arguments)
        return run_program(lambda: self.run(words), self.name, self.interruption)


def command(name: str) -> str:
    """Return the command of a program, in the form of the present call."""
    called = os.path.basename(sys.argv[0]).removesuffix(".exe") if sys.argv else ""
    return f"assoc {name}" if called == "assoc" else f"python -m assoc.{name}"


def run_program(program: Callable[[], None], name: str, interruption: Interruption | None = None) -> int:
    """Run a program; errors become one line on stderr and an exit code, signals those of ``interruption``."""
    try:
        with warnings_as_lines(name):
            program()
        sys.stdout.flush()
    except (InfeasibleError, LimitExceededError) as error:
        print(f"{name}: {one_line(error)}", file=sys.stderr)
        return NOTHING_FEASIBLE
    except AssocError as error:
        for line in (error, *getattr(error, "__notes__", ())):
            print(f"{name}: error: {one_line(line)}", file=sys.stderr)
        return BAD_INPUT
    except ModuleNotFoundError as error:
        if error.name not in _MAY_BE_MISSING:
            raise
        print(f"{name}: error: {error.name} is not installed: python -m pip install {error.name}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError:
        print(f"{name}: out of memory", file=sys.stderr)
        return NOTHING_FEASIBLE
    except KeyboardInterrupt:
        signalled = interruption is not None and interruption.code
        print(interruption.line() if interruption and signalled else f"{name}: interrupted", file=sys.stderr)
        return signalled or INTERRUPTED
    except BrokenPipeError:
        # the reader of stdout (head, less) closed it; keep Python from flushing to it again
        sys.stdout = None
        return DONE
    except OSError as error:
        # not handled elsewhere, for example a full disk behind stdout
        print(f"{name}: error: {one_line(error.strerror or error)}", file=sys.stderr)
        sys.stdout = None
        return BAD_INPUT
    finally:
        # Python otherwise ends with its own exit code after an interrupt has passed through an exec
        exec("")
    return DONE


def write_all(*outputs: tuple[object, Callable[[], object]]) -> None:
    """Write the outputs that are asked for (not None); if one fails the others are written, then it raises."""
    errors: list[AssocError] = []
    for asked, write in outputs:
        try:
            if asked is not None:
                write()
        except AssocError as error:
            errors.append(error)
    if errors:
        raise errors[0]


def prepare_streams() -> None:
    """Open closed standard streams, and let stdout and stderr print any file name."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # open takes the lowest free number: otherwise a file of the program could become stdout
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
