"""How programs end on Ctrl-C, a termination signal or a lost terminal.

`Interruption`: the work is interrupted, and finished results are kept. `EarlyEnd`: loops over scans end
early, and finished results are written; other work ends at once.

In both cases the signals are blocked and a thread waits for them. A Python handler would run only when a solver's
library returns, which can take minutes, and some MIP solvers install a handler of their own. The
exit code is that of shells: 128 plus the number of the signal.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

from assoc._system import temporary
from assoc._system.compile_time import is_compiling
from assoc._system.interrupts import ask_to_end

_CLEAN_UP_SECONDS = 5.0
# a solver that has been loading or compiling a kernel for so long will not end soon
_LOADING_SECONDS = 0.2
_AGAIN_SECONDS = 1.0


def ending_signals() -> dict[int, str]:
    """Signals that end a program, with their names in messages; without those that are ignored at the start (nohup)."""
    words = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
    if not hasattr(signal, "pthread_sigmask"):
        return {}
    numbers = {getattr(signal, name): text for name, text in words.items()}
    return {number: text for number, text in numbers.items() if signal.getsignal(number) is not signal.SIG_IGN}


class Interruption:
    """Whether and how a signal ended the program `name`, and the program's last line.

    `message` says what is kept and how to continue, `word` names the signal; `code` is the exit code, 0 before a
    signal.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.message = ""
        self.word = "interrupted"
        self.code = 0

    def line(self) -> str:
        """Return the program's last line."""
        return "; ".join(filter(None, [f"{self.name}: {self.word}", self.message]))

    def interrupt_on_signals(self) -> None:
        """Turn signals into one KeyboardInterrupt, even while a library works without Python.

        Worker processes do not receive them. A program that takes more than five seconds to clean up is ended.
        """
        ending = ending_signals()
        if not ending:
            return

        def interrupt(number: int, frame: object) -> None:
            if not self.code:
                # a library unblocked the signal for this thread
                self.word, self.code = ending[number], 128 + number
                _end_at_the_latest(self.code, f"{self.line()}\n")
            raise KeyboardInterrupt

        def end(number: int) -> None:
            self.word, self.code = ending[number], 128 + number
            _thread.interrupt_main()
            time.sleep(_CLEAN_UP_SECONDS)
            temporary.end_process(self.code, f"{self.line()}\n")

        _if_discarded(lambda: self.code != 0, _thread.interrupt_main)
        # the thread takes one signal: a second one must not interrupt cleaning up
        _wait_for_signals(ending, handler=interrupt, waiter=end)

    @contextmanager
    def reported(self, clean_up: Callable[[], object]) -> Iterator[None]:
        """Call `clean_up` and end the program with its last line if a signal interrupts the block."""
        try:
            yield
        except BaseException as error:
            # a library may answer the interrupt with another error
            if not (isinstance(error, KeyboardInterrupt) or self.code):
                raise
            clean_up()
            end_early(self.code or 128 + signal.SIGINT, f"{self.line()}\n")


class EarlyEnd:
    """Lets a signal end a program's work early, so that finished results are written; a second signal ends it at once.

    Outside `work` a signal ends the program at once.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        # reentrant: the handler may run while the main thread holds it
        self._lock = threading.RLock()
        self._working = False
        self._insists = False
        self._patience = 0.0
        self._signal = 0

    def on_signals(self) -> None:
        """Start to wait for signals."""
        ending = ending_signals()
        words = {number: f"{self._name}: {word}\n" for number, word in ending.items()}

        def leave(number: int) -> None:
            temporary.end_process(128 + number, words[number])

        def end(number: int, frame: object = None) -> None:
            with self._lock:
                if self._insists:
                    # Python also calls the handler of SIGINT to interrupt the main thread
                    self._insists = False
                    raise KeyboardInterrupt
                if self._signal or not self._working:
                    leave(number)
                self._signal = number
                ask_to_end()
            threading.Thread(target=self._insist, daemon=True).start()

        def wait(number: int) -> None:
            end(number)
            leave(signal.sigwait(ending))

        _if_discarded(lambda: self._working and self._signal != 0, self._interrupt)
        # the handler is for signals that a library unblocks
        _wait_for_signals(ending, handler=end, waiter=wait)

    def _insist(self) -> None:
        last = time.monotonic() + self._patience
        while time.monotonic() < last and not is_compiling(_LOADING_SECONDS):
            time.sleep(0.05)
        while self._working:
            self._interrupt()
            # in case that a library has discarded it
            time.sleep(_AGAIN_SECONDS)

    def _interrupt(self) -> None:
        with self._lock:
            if self._working:
                self._insists = True
                _thread.interrupt_main()

    @contextmanager
    def work(self, patience: float, kept: Callable[[], str] = lambda: "") -> Iterator[None]:
        """Let a signal end this block by `ask_to_end`, and by an interrupt if that takes more than ``patience`` s.

        After an interrupt the program ends and says what is ``kept``. What must not be interrupted comes after the
        block.
        """
        self._patience = patience
        with self._lock:
            self._working = True
        try:
            try:
                yield
            finally:
                # the interrupt may arrive as late as here
                with self._lock:
                    self._working = False
        except KeyboardInterrupt:
            self.say(kept())
            raise

    @property
    def asked(self) -> bool:
        """Whether there was a signal."""
        return self._signal != 0

    def say(self, kept: str) -> None:
        """If there was a signal, end the program with its name and with what was kept."""
        if self._signal:
            line = "; ".join(filter(None, [f"{self._name}: {ending_signals()[self._signal]}", kept]))
            end_early(128 + self._signal, f"{line}\n")


def end_early(code: int, line: str = "") -> NoReturn:
    """Write what was printed, and end the process: Python would wait for threads, and take compiled code apart."""
    # the reader of the output may have stopped
    _end_at_the_latest(code, line)
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    temporary.end_process(code, line)


def _end_at_the_latest(code: int, text: str) -> None:
    """End the process if it takes more than five seconds to clean up.

    An interrupt may leave a lock of a process pool locked for ever, and Python waits for its threads at the end.
    """
    timer = threading.Timer(_CLEAN_UP_SECONDS, temporary.end_process, (code, text))
    timer.daemon = True
    timer.start()


def _if_discarded(interrupted: Callable[[], bool], again: Callable[[], object]) -> None:
    """Interrupt the main thread again where Python discards the exception: in destructors and callbacks of C."""

    def unraisable(problem: Any) -> None:
        if problem.exc_type is KeyboardInterrupt and interrupted():
            again()
        else:
            sys.__unraisablehook__(problem)

    sys.unraisablehook = unraisable


def _wait_for_signals(
    ending: dict[int, str], handler: Callable[[int, object], object], waiter: Callable[[int], object]
) -> None:
    """Block the signals, and let a thread call ``waiter`` with the first one that arrives."""
    if not ending:
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)
    for number in ending:
        signal.signal(number, handler)
    threading.Thread(target=lambda: waiter(signal.sigwait(ending)), name="signals", daemon=True).start()
