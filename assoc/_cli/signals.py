"""How programs end on Ctrl-C and its kin."""

from __future__ import annotations

import multiprocessing
import signal
import threading

from assoc._system import temporary


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
