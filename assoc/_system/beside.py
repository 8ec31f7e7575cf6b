"""Background processes that compile kernels while this process goes on.

They end at once when a signal ends this process. When it ends normally they first finish the kernel that they are
compiling, for the next process.
"""

from __future__ import annotations

import atexit
import base64
import functools
import os
import pickle
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any

from assoc._system.interrupts import end_is_asked
from assoc._system.processes import start_python

LEAVE = b"leave\n"
# module of these processes, by name: it imports interpreted.py, which imports this module
_SERVE = "assoc._system.ahead"


@functools.cache
def has_room() -> bool:
    """Whether the machine has a core for another process."""
    return (os.cpu_count() or 1) > 1


def call_beside(module: str, name: str) -> subprocess.Popen[bytes]:
    """Start a process that calls a function and ends."""
    # a session of its own: Ctrl-C goes to this program alone, and this program ends the process
    return start_python(_SERVE, module, name, start_new_session=True)


class _Beside:
    """The process that compiles kernels which are interpreted meanwhile."""

    def __init__(self) -> None:
        self._asked: set[Any] = set()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, module: str, name: str, kinds: Any) -> None:
        """Request compilation of a kernel for these argument types, if there is a core for it."""
        with self._lock:
            if self._owner != os.getpid():
                # a forked process has inherited its parent's
                self._asked, self._process, self._owner = set(), None, os.getpid()
            if (module, name, kinds) in self._asked or not has_room():
                return
            self._asked.add((module, name, kinds))
            try:
                if self._process is None:
                    # a process group of its own shields it from Ctrl-C; in a session of its own it would get an
                    # equal share of the cores whatever its nice value (sched(7), autogroups)
                    self._process = start_python(_SERVE, process_group=0)
                self._write(base64.b64encode(pickle.dumps((module, name, kinds))) + b"\n")
            except (OSError, ValueError):
                # the process died or could not start: this process compiles the kernel after `PATIENCE`
                self._process = None

    def leave(self) -> None:
        """Let the process finish its current kernel, unless Ctrl-C ends this one."""
        interrupted = end_is_asked() or getattr(sys, "last_type", None) is KeyboardInterrupt
        if self._process is not None and self._owner == os.getpid() and not interrupted:
            with suppress(OSError, ValueError):
                self._write(LEAVE)

    def _write(self, line: bytes) -> None:
        assert self._process is not None and self._process.stdin is not None
        self._process.stdin.write(line)
        self._process.stdin.flush()


beside = _Beside()
atexit.register(beside.leave)
