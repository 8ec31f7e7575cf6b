"""List of this process's temporary files and folders: a process that must end at once removes them first."""

from __future__ import annotations

import atexit
import os
import shutil
import threading
from contextlib import suppress
from typing import NoReturn

lock = threading.RLock()
"""Held while a temporary file is created and listed, or renamed and taken off the list."""

_paths: dict[str, int] = {}


def add(path: str) -> None:
    """Put a file or folder of this process on the list."""
    with lock:
        # a forked child has a copy of its parent's list, and must not remove those files
        _paths[path] = os.getpid()


def forget(path: str) -> None:
    """Take a path off the list: it was removed or has got its final name."""
    with lock:
        _paths.pop(path, None)


def remove(path: str) -> None:
    """Remove a file or folder, ignoring errors, and take it off the list."""
    with suppress(OSError):
        os.unlink(path) if not os.path.isdir(path) else shutil.rmtree(path, ignore_errors=True)
    forget(path)


def end_process(code: int, message: str = "") -> NoReturn:
    """End the process now: remove unfinished files, keep other threads from making more, wait for nothing else."""
    # the lock's holder may hang in a file system that does not answer
    lock.acquire(timeout=2.0)
    for path, owner in [*_paths.items()]:
        if owner == os.getpid():
            remove(path)
    with suppress(OSError):
        os.write(2, message.encode(errors="backslashreplace"))
    os._exit(code)


@atexit.register
def _at_exit() -> None:
    for path, owner in [*_paths.items()]:
        if owner == os.getpid():
            remove(path)
