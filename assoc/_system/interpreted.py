"""Small calls of kernels that are not compiled yet are interpreted, while another process compiles them.

After an installation each kernel takes seconds to compile. But a kernel is also a Python function: on a small scene it
takes a hundredth of a second interpreted, a ten-thousandth compiled. So a call with small arrays is interpreted while
the kernel is in no cache, and a background process compiles it; once it is in the cache on disk it is loaded. A call
with large arrays waits for the compiler, and so does a kernel that was interpreted for longer than compiling takes.
Results are the same to the last bit.

``ASSOC_INTERPRET=0`` switches this off.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from assoc._system.helpers import beside, has_room

# total elements of a call's arrays up to which it may be interpreted
SMALL = 6000
# processor seconds for which a kernel is interpreted, over all calls: about what compiling takes
PATIENCE = 6.0
# seconds between two checks whether the kernel is in the cache
_LOOK = 0.5

_switched_on = os.environ.get("ASSOC_INTERPRET", "1") != "0"


@contextlib.contextmanager
def compiled_only() -> Iterator[None]:
    """Interpret nothing in this thread: for callers that need compiled code now."""
    before, thread.never = thread.never, True
    try:
        yield
    finally:
        thread.never = before


@contextlib.contextmanager
def interpreted_only() -> Iterator[None]:
    """Compile nothing in this thread: for small steps that prepare a compilation."""
    before, thread.interpreting = thread.interpreting, True
    try:
        yield
    finally:
        thread.interpreting = before


class _Thread(threading.local):
    """Settings of a thread."""

    # whether a kernel that is in no cache may be interpreted instead
    may_interpret = False
    # whether nothing may be interpreted
    never = False
    # whether an interpreted kernel runs: the kernels that it calls are interpreted with it
    interpreting = False


thread = _Thread()


def first_small(
    kernel: Any, compiled: Callable[..., Any], small: int, stand_in: Callable[..., Any] | None
) -> Callable[..., Any]:
    """Return the function, for ``kernel._compile_for_args``, that handles new types: it loads, interprets or compiles.

    ``compiled`` loads or compiles the kernel, or returns None where it is to be interpreted. A call may be interpreted
    whose arguments have at most ``small`` elements; by ``stand_in``, if the Python function itself cannot be.
    """
    function = stand_in or kernel.py_func
    spent = 0.0
    checked = -_LOOK

    def interpreted(*arguments: Any) -> Any:
        nonlocal spent
        started = time.thread_time()
        thread.interpreting = True
        try:
            # compiled code ignores overflow
            with np.errstate(all="ignore"):
                return function(*arguments)
        finally:
            thread.interpreting = False
            spent += time.thread_time() - started

    def choose(*arguments: Any) -> Any:
        nonlocal checked
        if thread.interpreting:
            return function
        if thread.never or spent > PATIENCE or _elements(arguments) > small:
            return compiled(*arguments)
        if time.monotonic() - checked < _LOOK:
            return interpreted
        thread.may_interpret = True
        try:
            found = compiled(*arguments)
        finally:
            thread.may_interpret = False
        if found is None:
            checked = time.monotonic()
            kinds = tuple(map(kernel.typeof_pyval, arguments))
            beside.ask(kernel.py_func.__module__, kernel.py_func.__qualname__, kinds)
            return interpreted
        return found

    return choose if _switched_on else compiled


def _elements(value: Any) -> int:
    if isinstance(value, np.ndarray):
        return value.size
    return sum(map(_elements, value)) if isinstance(value, tuple) else 0


def may_use_processes() -> bool:
    """Whether another process may compile for this thread."""
    return _switched_on and not thread.never and has_room()
