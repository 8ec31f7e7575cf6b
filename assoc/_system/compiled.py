"""The one way to numba: lazy signatures, cached on disk, without the GIL, and never stale.

numba keeps a compiled kernel as long as the kernel's own file is unchanged, so an edited helper in another
file, or an upgrade that leaves one file as it was, would leave stale code, and an edited comment would compile anew
what is below it. Here the stamp of every kernel is that of what it can reach (kernel_stamp.py). Where no cache folder
can be written (a read-only installation and home), numba would fail at import; the cache then goes to a temporary
folder, and where there is none of these either, nothing is kept.
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import caching, event, types

from assoc._system import compile_time, shipped, temporary
from assoc._system.in_time import end_if_abandoned, uninterrupted
from assoc._system.inner_library import InnerCompiler
from assoc._system.interpreted import SMALL, SMALL_SEARCH, NotCompiled, first_small, thread
from assoc._system.kernel_stamp import KernelStamp, argument_kinds

_PACKAGE = Path(__file__).resolve().parents[1]

# nobody calls kernels as functions of C: what would let them is left out
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_INNER_OPTIONS = {**_OPTIONS, "no_cpython_wrapper": True}
# functions of inner kernels
_inner: set[Callable[..., Any]] = set()

_CACHES: Any = caching.CacheImpl
_CONFIG: Any = numba.config
_EVENT: Any = event
_TYPES: Any = types
_STANDARD_LOCATORS = tuple(_CACHES._locator_classes)


class _PackageCacheLocator:
    """Finds numba's usual cache place for kernels of this package, with the package's stamp."""

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        path = Path(py_file).resolve()
        if not path.is_relative_to(_PACKAGE):
            return None
        for standard in _STANDARD_LOCATORS:
            locator = standard.from_function(py_func, py_file)
            if locator is not None:
                break
        else:
            # for the processes that this one starts, too; it goes when this process ends
            folder = tempfile.mkdtemp(prefix="assoc-numba-")
            temporary.add(folder)
            _CONFIG.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = folder
            locator = _STANDARD_LOCATORS[0].from_function(py_func, py_file)
        # neither the place in the file nor its time: a copied or checked-out tree keeps its compiled kernels
        options = _INNER_OPTIONS if py_func in _inner else _OPTIONS
        locator.get_source_stamp = lambda: KernelStamp(py_func, options)
        locator.get_disambiguator = lambda: "kernel"
        return locator


_CACHES._locator_classes = [_PackageCacheLocator, *_STANDARD_LOCATORS]


_FUNCTION_CACHE: Any = caching.FunctionCache


class _KernelCache(_FUNCTION_CACHE):  # type: ignore[misc]
    """numba's cache of one kernel, which is a help and never an obstacle."""

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Tell records apart whose fields have the same types in another order."""
        return (*super()._index_key(sig, codegen), argument_kinds(sig))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep compiled code; on a full disk, say, it is compiled again next time."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load compiled code, own or shipped; what cannot be read (cut by a crash) is compiled again, and replaced."""
        try:
            found = super().load_overload(sig, target_context)
        except Exception:
            # an index that cannot be read cannot be added to either
            with contextlib.suppress(OSError):
                self.flush()
            found = None
        if found is None:
            with contextlib.suppress(Exception):
                found = shipped.load(self, sig, target_context)
        if found is None and thread.may_interpret:
            raise NotCompiled
        return found


def _common(kind: Any) -> Any:
    """The type for which a kernel is compiled where another one gives it a whole number: always the same."""
    if isinstance(kind, (_TYPES.IntegerLiteral, _TYPES.BooleanLiteral)):
        kind = kind.literal_type
    if isinstance(kind, _TYPES.Integer) and kind.signed and kind.bitwidth < 64:
        return _TYPES.int64
    if type(kind) in (_TYPES.Tuple, _TYPES.UniTuple):
        return _TYPES.Tuple(tuple(map(_common, kind)))
    return kind


def _called_with_common_types(kernel: Any) -> Callable[..., Any]:
    """What answers kernels that call this one: numba would compile it for each literal number and each width anew."""
    call_template = kernel.get_call_template

    def template(args: Any, kws: Any) -> Any:
        return call_template(tuple(map(_common, args)), {name: _common(kind) for name, kind in dict(kws).items()})

    return template


class _Passes(event.Listener):
    """Between two passes of the compiler nothing is half done: what nobody waits for ends there."""

    def on_start(self, event: Any) -> None:
        end_if_abandoned()

    def on_end(self, event: Any) -> None:
        pass


def _uninterrupted(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """Let no signal's handler raise while kernels are compiled or loaded: LLVM calls Python where that is a crash."""

    def aside(may_interpret: bool, arguments: tuple[Any, ...]) -> Any:
        thread.may_interpret = may_interpret
        try:
            with event.install_listener("numba:run_pass", _Passes()):
                return compiled(*arguments)
        except NotCompiled:
            return None
        finally:
            thread.may_interpret = False

    def wait(*arguments: Any) -> Any:
        may_interpret = thread.may_interpret
        with compile_time.loading():
            return uninterrupted(lambda: aside(may_interpret, arguments))

    return wait


def njit(
    function: Callable[..., Any],
    *,
    small: int = SMALL,
    stand_in: Callable[..., Any] | None = None,
    literal: bool = False,
) -> Any:
    """Compile a kernel: ``numba.njit`` with ``cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True``.

    Until it is compiled, calls with arrays of at most ``small`` elements together are interpreted (interpreted.py), by
    ``stand_in`` where that is given.

    Kernels that call it give it whole numbers as int64, whatever their own are; with ``literal`` as they are.

    With ``NUMBA_DISABLE_JIT=1`` the function runs as it is, and is as silent about overflow as compiled code.
    """
    if _CONFIG.DISABLE_JIT:

        @functools.wraps(function)
        def silent(*arguments: Any) -> Any:
            with np.errstate(all="ignore"):
                return function(*arguments)

        return silent
    kernel: Any = numba.njit(**_OPTIONS)(function)
    kernel._compile_for_args = _uninterrupted(kernel._compile_for_args)
    if not literal:
        kernel.get_call_template = _called_with_common_types(kernel)
    # nowhere to keep it, not even for a while: each process compiles for itself
    with contextlib.suppress(OSError):
        kernel._cache = _KernelCache(function)
        kernel._compile_for_args = first_small(kernel, small, stand_in)
    return kernel


def search_njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel that searches a tree: as `njit`, but interpreted only where its arrays are very small."""
    return njit(function, small=SMALL_SEARCH)


def inner_njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel that other kernels alone call, without what lets Python call it.

    That takes arrays out of their objects and puts them in again: most of the code of a small kernel of many arrays.
    It is optimised and translated in the kernels that call it alone (inner_library.py).
    Where Python calls it (tests do) it is interpreted.
    """
    if _CONFIG.DISABLE_JIT:
        return njit(function)
    _inner.add(function)
    kernel: Any = numba.njit(**_INNER_OPTIONS, pipeline_class=InnerCompiler)(function)
    kernel.get_call_template = _called_with_common_types(kernel)

    @functools.wraps(function)
    def silent(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    # there is nothing that Python could call, so that it must find nothing
    kernel._insert = lambda *overload: None
    kernel._compile_for_args = lambda *arguments: function if thread.interpreting else silent
    with contextlib.suppress(OSError):
        kernel._cache = _KernelCache(function)
    return kernel


def literal_njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel as `njit`, but anew for each literal number that it is given: its loops are unrolled then."""
    return njit(function, literal=True)


def is_kept(kernel: Any) -> bool:
    """Whether compiled code of a kernel, for whatever arguments, is in this process, on disk, or came along."""
    if _CONFIG.DISABLE_JIT or kernel.signatures or shipped.FOLDER.is_dir():
        return True
    try:
        return bool(kernel._cache._cache_file._load_index())
    except Exception:
        # no cache at all, or one that cannot be read
        return False


class _Loads(event.Listener):
    """Counts how often the compiler was asked, for code to compile or to load from the cache, and how long it took."""

    def __init__(self) -> None:
        self.count = 0

    def on_start(self, event: Any) -> None:
        self.count += 1
        compile_time.entered()

    def on_end(self, event: Any) -> None:
        compile_time.left()


_loads = _Loads()
_EVENT.register("numba:compiler_lock", _loads)


def loaded() -> tuple[int, int]:
    """Return numbers that change when code is compiled, loaded from the cache, or imported in this process."""
    return _loads.count, len(sys.modules)
