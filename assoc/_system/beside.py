"""Processes that compile kernels beside this one, which works on with what is there.

They end at once when this process is ended by a signal, in whatever they are at. When it ends in order, they first
finish the kernel that they are at, for the next process.
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
# where these processes begin, by name: that file knows what is interpreted, which uses this one
_SERVE = "assoc._system.ahead"


@functools.cache
def has_room() -> bool:
    """Whether there is a core for another process."""
    return (os.cpu_count() or 1) > 1


def call_beside(module: str, name: str) -> subprocess.Popen[bytes]:
    """Let another process call a function, and end."""
    # Ctrl-C is for the program, with which this process ends
    return start_python(_SERVE, module, name, start_new_session=True)


class _Beside:
    """The process that compiles what is interpreted meanwhile."""

    def __init__(self) -> None:
        self._asked: set[Any] = set()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, module: str, name: str, kinds: Any) -> None:
        """Let a kernel be compiled for arguments of such types, if there is a core for that."""
        with self._lock:
            if self._owner != os.getpid():
                # a forked process has a copy of its parent's
                self._asked, self._process, self._owner = set(), None, os.getpid()
            if (module, name, kinds) in self._asked or not has_room():
                return
            self._asked.add((module, name, kinds))
            try:
                if self._process is None:
                    # a group of its own for Ctrl-C; in a session of its own the process would get an equal share of
                    # the cores, whatever its nice value (sched(7), autogroups)
                    self._process = start_python(_SERVE, process_group=0)
                self._write(base64.b64encode(pickle.dumps((module, name, kinds))) + b"\n")
            except (OSError, ValueError):
                # no process to be had, or it has died: this one compiles, once its patience is over
                self._process = None

    def leave(self) -> None:
        """Let the process finish what it is at, unless this one ends because of Ctrl-C."""
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
