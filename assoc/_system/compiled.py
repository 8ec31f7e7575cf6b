"""The only way to numba: kernels compiled at their first call, cached on disk, run without the GIL, never stale.

On arguments of new types a kernel is loaded from the cache, interpreted if the call is small (interpreted.py), or
compiled. Private names of numba are used only in numba_private.py and kernels/lowering.py; where they are missing
kernels are plain numba.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import inspect
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Any

import numba
import numpy as np
from numba.core import event

from assoc._system import compile_time
from assoc._system.helpers import call_beside
from assoc._system.interpreted import SMALL, compiled_only, first_small, may_use_processes, thread
from assoc._system.interrupts import end_if_abandoned, uninterrupted

private: Any = None
with contextlib.suppress(ImportError, AttributeError):
    from assoc._system import numba_private

    private = numba_private if numba_private.COMPLETE else None

_CONFIG: Any = numba.config
_EVENT: Any = event
_loads = 0
# seconds of compiling for which a deadline moves
_NOTICED = 0.01


def njit(
    function: Callable[..., Any],
    *,
    small: int = SMALL,
    stand_in: Callable[..., Any] | None = None,
    literal: bool = False,
) -> Any:
    """Compile a kernel: ``numba.njit`` with ``cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True``.

    Until the kernel is compiled, calls whose arrays have at most ``small`` elements together are interpreted
    (interpreted.py), by ``stand_in`` if given.

    Kernels that call it pass whole numbers as int64, whatever their type; with ``literal`` they pass them unchanged.

    With ``NUMBA_DISABLE_JIT=1`` the Python function runs, and ignores overflow as compiled code does.
    """
    if _CONFIG.DISABLE_JIT:
        return _silent(function)
    if private is None:
        return _plain(function)
    kernel = private.make(function, _may_wait, literal=literal, lean=literal)
    compiled = _uninterrupted(kernel)
    kernel._compile_for_args = first_small(kernel, compiled, small, stand_in) if private.is_cached(kernel) else compiled
    return kernel


def literal_njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel with `njit`, once for each literal number passed to it, so that its loops are unrolled.

    It must be as `lean_inner_njit` asks.
    """
    return njit(function, literal=True)


def lean_inner_njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel with `inner_njit` that counts no references to arrays, not even to views that it takes.

    In a small kernel that takes longer than the rest. It must not make or return arrays, nor call kernels that return
    some.
    """
    return inner_njit(function, lean=True)


def inner_njit(function: Callable[..., Any], *, lean: bool = False) -> Any:
    """Compile a kernel that only other kernels call, without the code that lets Python call it.

    That code unpacks and packs arrays: it is most of the code of a small kernel with many arrays.
    A call from Python (in tests) is interpreted.
    """
    if _CONFIG.DISABLE_JIT or private is None:
        return njit(function)
    kernel = private.make(function, _may_wait, inner=True, lean=lean)
    silent = _silent(function)
    # the wrapper for calls from Python is missing, so no such code may be found
    kernel._insert = lambda *overload: None
    kernel._compile_for_args = lambda *arguments: function if thread.interpreting else silent
    return kernel


def draws(generator: np.random.Generator) -> np.random.Generator:
    """The generator as kernels may be given it: where they are given numpy's own, a signal may crash the process."""
    return generator if private is None or isinstance(generator, private.Draws) else private.Draws(generator)


def for_kernels(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The array in C order and writeable: kernels are not compiled once more for read-only ones or parts of others."""
    return array if array.flags.carray else np.require(array, requirements=("C", "W"))


def is_kept(kernel: Any) -> bool:
    """Whether compiled code of a kernel, for any types, is in this process, on disk, or shipped with the package."""
    return bool(_CONFIG.DISABLE_JIT or private is None or private.is_kept(kernel))


_under_way: list[subprocess.Popen[bytes]] = []
# kernels known to be compiled: looking for their code takes longer than a small problem
_kept: set[Any] = set()


def compile_ahead(kernel: Any, prepare: Callable[[], object], *, anyway: bool = False) -> bool:
    """Let another process call ``prepare``, if the disk holds no compiled code of a kernel; return whether it does.

    On two cores this halves the wait at the first hard problem after an installation. ``prepare`` is a function at the
    top level of a module, which calls the kernel. ``anyway``: also where this thread interprets nothing, so that all it
    needs must be compiled.
    """
    if _under_way or kernel in _kept or not (anyway or may_use_processes()):
        return False
    if is_kept(kernel):
        _kept.add(kernel)
        return False
    try:
        _under_way.append(call_beside(prepare))
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
                time.sleep(0.02)
            if helper.stdin is not None:
                helper.stdin.close()


def compile_for(kernel: Any, *arguments: Any) -> None:
    """Compile or load a kernel for arguments like these, without calling it."""
    with compiled_only():
        kernel._compile_for_args(*arguments)


def loaded() -> tuple[int, int]:
    """Return numbers that change when this process compiles code, loads it from the cache, or imports it."""
    return _loads, len(sys.modules)


class _Loads(event.Listener):
    """Counts whatever is compiled or loaded, also kernels that a user compiles with numba itself."""

    def on_start(self, event: Any) -> None:
        global _loads
        _loads += 1

    def on_end(self, event: Any) -> None:
        pass


def with_foreign_kernels() -> AbstractContextManager[None]:
    """Let `loaded` notice within the block what others' kernels load, such as those of a user's solver."""
    return _EVENT.install_listener("numba:compiler_lock", _Loads())


def _silent(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def silent(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return silent


def _plain(function: Callable[..., Any]) -> Any:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        return numba.njit(**options, cache=True)(function)
    except RuntimeError:
        # no folder for a cache
        return numba.njit(**options)(function)


def _may_wait() -> bool:
    return not thread.may_interpret


class _Passes(event.Listener):
    """Ends abandoned work between two passes of the compiler, where its data are consistent."""

    def on_start(self, event: Any) -> None:
        end_if_abandoned()
        compile_time.announcement.begin()

    def on_end(self, event: Any) -> None:
        pass


@contextlib.contextmanager
def _no_collection() -> Iterator[None]:
    """Let Python's collector rest: what the compiler makes lives on, and searching it takes a tenth of its time."""
    rests = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if rests:
            gc.enable()


def _uninterrupted(kernel: Any) -> Callable[..., Any]:
    """Keep signal handlers from raising while a kernel is compiled or loaded: inside LLVM that would crash.

    The returned function gives None for a kernel that is in no cache and may be interpreted instead. The call that it
    was compiled for gets its deadline later by the time that this took.
    """
    compiled = kernel._compile_for_args

    def aside(may_interpret: bool, arguments: tuple[Any, ...]) -> Any:
        thread.may_interpret = may_interpret
        try:
            with _EVENT.install_listener("numba:run_pass", _Passes()), _no_collection():
                return compiled(*arguments)
        except private.NotCompiled:
            return None
        finally:
            thread.may_interpret = False

    def wait(*arguments: Any) -> Any:
        global _loads
        _loads += 1
        may_interpret, started = thread.may_interpret, time.perf_counter()
        with compile_time.loading():
            found = uninterrupted(lambda: aside(may_interpret, arguments))
            compile_time.announcement.end()
        spent = time.perf_counter() - started
        if found is None or spent < _NOTICED:
            return found
        names = [*inspect.signature(kernel.py_func).parameters]
        return lambda *given: found(*(_later(*pair, spent) for pair in zip(names, given, strict=True)))

    return wait


def _later(name: str, value: Any, seconds: float) -> Any:
    """An argument of a kernel, or a record of them, with its deadline (clock.py) moved."""
    if name == "deadline":
        return value + seconds
    return value._replace(deadline=value.deadline + seconds) if hasattr(value, "deadline") else value
