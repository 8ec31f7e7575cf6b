"""Processes that compile kernels while this one goes on.

They end at once when a signal ends this process. When it ends normally they first finish the kernel that they are
compiling, for the next process.
"""

from __future__ import annotations

import atexit
import functools
import operator
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

from assoc._system import temporary
from assoc._system.first_import import path_without
from assoc._system.interrupts import end_is_asked
from assoc._system.processes import leave, send, start_python

# nice value of the process that compiles what is interpreted meanwhile
_NICE = 10


@functools.cache
def has_room() -> bool:
    """Whether the machine has a core for another process."""
    return (os.cpu_count() or 1) > 1


def call_beside(function: Callable[[], object]) -> subprocess.Popen[bytes]:
    """Start a process that calls a function and ends."""
    # a session of its own: Ctrl-C goes to this program alone, and this program ends the process
    process = _start(start_new_session=True)
    send(process, functools.partial(_call_and_end, function.__module__, function.__qualname__))
    return process


def _call_and_end(module: str, name: str) -> None:
    try:
        getattr(import_module(module), name)()
    finally:
        temporary.end_process(0)


def _start(**options: Any) -> subprocess.Popen[bytes]:
    """Start a process that calls the functions that it is sent and interprets nothing."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = start_python(path_without(), env=os.environ | {"ASSOC_INTERPRET": "0"}, **quiet, **options)
    send(process, operator.call)
    return process


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
                    self._process = _start(process_group=0)
                    if hasattr(os, "nice"):
                        send(self._process, functools.partial(os.nice, _NICE))
                send(self._process, functools.partial(compile_kernel, module, name, kinds))
            except (OSError, ValueError):
                # the process died or could not start: this process compiles the kernel after `PATIENCE`
                self._process = None

    def leave(self) -> None:
        """Let the process finish its current kernel, unless Ctrl-C ends this one."""
        interrupted = end_is_asked() or getattr(sys, "last_type", None) is KeyboardInterrupt
        if self._process is not None and self._owner == os.getpid() and not interrupted:
            with suppress(OSError, ValueError):
                leave(self._process)


def compile_kernel(module: str, name: str, kinds: Any) -> None:
    """Compile a kernel for argument types."""
    getattr(import_module(module), name).compile(kinds)


beside = _Beside()
atexit.register(beside.leave)
