"""Kernels that a hard problem will need are compiled in another process, while this one compiles those it needs first.

On two cores the first hard problem after an installation then waits half as long.
"""

from __future__ import annotations

import base64
import os
import pickle
import queue
import subprocess
import threading
from collections.abc import Callable
from importlib import import_module
from typing import Any

from assoc._system import compile_time, interpreted
from assoc._system.beside import LEAVE, call_beside
from assoc._system.compiled import is_kept

# how far the process that compiles what is interpreted meanwhile stands back
_NICE = 10

_under_way: list[subprocess.Popen[bytes]] = []
# kernels that are known to be compiled: looking for their code takes longer than a small problem
_kept: set[Any] = set()


def compile_ahead(kernel: Any, prepare: Callable[[], object], *, anyway: bool = False) -> bool:
    """Let another process call ``prepare``, if no compiled code of the kernel that it is for is on disk.

    Parameters
    ----------
    kernel : Dispatcher
    prepare : callable
        A function at the top level of a module, which calls the kernel.
    anyway : bool
        Also where this thread interprets nothing: all that it needs is to be compiled.

    Returns
    -------
    bool
        Whether another process has begun to.
    """
    if _under_way or kernel in _kept or not (anyway or interpreted.may_use_processes()):
        return False
    if is_kept(kernel):
        _kept.add(kernel)
        return False
    try:
        _under_way.append(call_beside(prepare.__module__, prepare.__qualname__))
    except OSError:
        # no process to be had: this one compiles
        return False
    return True


def wait_for_kernels() -> None:
    """Wait for what is compiled ahead: compiling it here, too, would take longer."""
    while _under_way:
        with compile_time.loading():
            _under_way.pop().wait()


def serve(*call: str) -> None:
    """Call a function, given by its module and name; without one compile what the lines of stdin ask for."""
    asked: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    leaving = threading.Event()

    def listen() -> None:
        for line in open(0, "rb", closefd=False):
            if line == LEAVE:
                leaving.set()
            asked.put(line)
        if not leaving.is_set():
            os._exit(1)

    threading.Thread(target=listen, daemon=True).start()
    if call:
        module, name = call
        with interpreted.compiled_only():
            getattr(import_module(module), name)()
    else:
        if hasattr(os, "nice"):
            # nobody waits for this process, so that it leaves the cores to those that somebody waits for
            os.nice(_NICE)
        while not leaving.is_set():
            line = asked.get()
            if line != LEAVE:
                module, name, kinds = pickle.loads(base64.b64decode(line))
                getattr(import_module(module), name).compile(kinds)
    # without waiting for the thread that listens
    os._exit(0)
