"""Kernels that a hard problem will need later are compiled in another process, while this one compiles the first ones.

On two cores this halves the wait at the first hard problem after an installation.
"""

from __future__ import annotations

import base64
import os
import pickle
import queue
import subprocess
import threading
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from assoc._system import compile_time, interpreted
from assoc._system.beside import LEAVE, call_beside
from assoc._system.compiled import is_kept

_POLL = 0.02
# nice value of the process that compiles what is interpreted meanwhile
_NICE = 10

_under_way: list[subprocess.Popen[bytes]] = []
# kernels known to be compiled: looking for their code takes longer than a small problem
_kept: set[Any] = set()


def compile_ahead(kernel: Any, prepare: Callable[[], object], *, anyway: bool = False) -> bool:
    """Let another process call ``prepare``, if the disk holds no compiled code of a kernel.

    Parameters
    ----------
    kernel : Dispatcher
    prepare : callable
        A function at the top level of a module, which calls the kernel.
    anyway : bool
        Also where this thread interprets nothing, so that all it needs must be compiled.

    Returns
    -------
    bool
        Whether another process was started.
    """
    if _under_way or kernel in _kept or not (anyway or interpreted.may_use_processes()):
        return False
    if is_kept(kernel):
        _kept.add(kernel)
        return False
    try:
        _under_way.append(call_beside(prepare.__module__, prepare.__qualname__))
    except OSError:
        # no process could be started: this one compiles
        return False
    return True


def wait_for_kernels() -> None:
    """Wait for the kernels that are compiled ahead: compiling them here as well would take longer."""
    while _under_way:
        with compile_time.loading():
            helper = _under_way.pop()
            # an endless wait would not end when another thread receives a signal
            while helper.poll() is None:
                time.sleep(_POLL)


def serve(*call: str) -> None:
    """Call a function, given by its module and name; without arguments compile the kernels that stdin lists."""
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
            # nobody waits for this process: give way to others
            os.nice(_NICE)
        while not leaving.is_set():
            line = asked.get()
            if line != LEAVE:
                module, name, kinds = pickle.loads(base64.b64decode(line))
                getattr(import_module(module), name).compile(kinds)
    # do not wait for the listening thread
    os._exit(0)
