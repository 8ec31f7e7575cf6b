"""All uses of numba's private names, but for how code is made of kernels (kernels/lowering.py).

A kernel is a numba dispatcher with attributes of this package: its cache (`_KernelCache`), what it does on arguments of
new types, and how it is called from other kernels. numba's modules and classes stay unchanged. Where one of the names
of `COMPLETE` is missing, kernels are plain ``numba.njit(cache=True)`` (compiled.py): slower at first contact, with the
same results.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import (
    caching,
    cgutils,
    codegen,
    compiler,
    compiler_machinery,
    extending,
    options,
    registry,
    typed_passes,
    types,
)
from numba.core.typing.typeof import typeof_impl
from numba.np.random.generator_core import NumPyRandomGeneratorTypeModel

from assoc._system import temporary
from assoc._system.kernel_stamp import KernelStamp, argument_kinds
from assoc._system.kernels.lowering import Lower

# numba has no type annotations
_CACHING: Any = caching
_CODEGEN: Any = codegen
_COMPILER: Any = compiler
_MACHINERY: Any = compiler_machinery
_PASSES: Any = typed_passes
_CONFIG: Any = numba.config
# numba 0.60 has it with an underscore
_IN_TREE: Any = getattr(caching, "InTreeCacheLocator", None) or _CACHING._InTreeCacheLocator
_TYPES: Any = types
_EXTENDING: Any = extending
_CGUTILS: Any = cgutils

COMPLETE = all(
    hasattr(owner, name)
    for owner, names in {
        _CACHING.FunctionCache: "_index_key load_overload save_overload flush",
        _CACHING.CompileResultCacheImpl: "_locator_classes filename_base locator rebuild",
        _CACHING.IndexDataCacheFile: "_load_index load",
        _IN_TREE: "from_function get_source_stamp get_disambiguator get_suitable_cache_subpath",
        registry.CPUDispatcher: "_compile_for_args _insert enable_caching get_call_template typeof_pyval",
        options.DefaultOptions: "no_cfunc_wrapper no_cpython_wrapper _nrt",
        _CODEGEN.JITCPUCodegen: "magic_tuple",
        _CODEGEN.JITCodeLibrary: "_optimize_final_module _finalize_final_module _get_module_for_linking"
        " enable_object_caching",
        _COMPILER.Compiler: "compile_extra",
        _COMPILER.Flags: "copy summary",
        _COMPILER.CompilerBase: "define_pipelines",
        _PASSES.NativeLowering: "lowering_class",
        Lower: "incref loadvar getvar _alloca_var _find_singly_assigned_variable",
        types: "NumPyRandomGeneratorType NumPyRandomBitGeneratorType npy_rng",
    }.items()
    for name in names.split()
)
"""Whether this numba has all the classes and methods used here."""

PACKAGE = Path(__file__).resolve().parents[1]
SHIPPED = PACKAGE / "_kernels"
"""Compiled kernels shipped with the package; a wheel may hold them (``tests/release/kernels.py``)."""
# the cache folder if numba finds none, also for the processes that this one starts
_FOLDER = "ASSOC_CACHE_DIR"
# kernels are not called from C, nor inner ones from Python: the code for such calls is left out
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_INNER = {"no_cpython_wrapper": True}
# what makes no arrays counts no references, to views neither: in small kernels that takes longer than the rest
_LEAN = {"_nrt": False}


class NotCompiled(Exception):  # noqa: N818  (not an error)
    """The kernel is in no cache and is not to be compiled now."""


def make(
    function: Callable[..., Any],
    may_wait: Callable[[], bool],
    *,
    inner: bool = False,
    literal: bool = False,
    lean: bool = False,
) -> Any:
    """Make a kernel, with a cache where there is a folder for one.

    ``may_wait`` returns whether a kernel that is in no cache is to be compiled now; otherwise `NotCompiled` is raised.
    ``inner``: only kernels call it. ``literal``: calls from kernels compile it anew for each literal number and each
    width of whole numbers. ``lean``: it makes and returns no arrays, so that it needs no counts of references at all.
    """
    chosen = _OPTIONS | (_INNER if inner else {}) | (_LEAN if lean else {})
    kernel: Any = numba.njit(**chosen, pipeline_class=_InnerCompiler if inner else _Compiler)(function)
    if not literal:
        kernel.get_call_template = _called_with_common_types(kernel)
    # no folder, not even a temporary one: each process compiles for itself
    with contextlib.suppress(OSError):
        kernel._cache = _KernelCache(function, chosen, may_wait)
    return kernel


def is_cached(kernel: Any) -> bool:
    """Whether a kernel has a cache."""
    return isinstance(kernel._cache, _KernelCache)


def is_kept(kernel: Any) -> bool:
    """Whether compiled code of a kernel, for any types, is in this process, on disk, or shipped with the package."""
    if kernel.signatures or SHIPPED.is_dir():
        return True
    try:
        return bool(kernel._cache._cache_file._load_index())
    except Exception:
        # no cache, or an unreadable one
        return False


class _KernelCache(_CACHING.FunctionCache):  # type: ignore[misc]
    """numba's cache of one kernel, with this package's stamps; its failures are never errors."""

    def __init__(self, function: Any, chosen: Mapping[str, object], may_wait: Callable[[], bool]) -> None:
        self._impl_class = functools.partial(_Implementation, _Place(chosen))
        self._may_wait = may_wait
        super().__init__(function)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Tell records apart whose fields have the same types in a different order."""
        return (*super()._index_key(sig, codegen), argument_kinds(sig))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save compiled code; if that fails (a full disk) it is compiled again next time."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load compiled code, local or shipped; unreadable code (cut by a crash) is compiled again and replaced."""
        try:
            found = super().load_overload(sig, target_context)
        except Exception:
            # numba cannot add to an index that it cannot read
            with contextlib.suppress(OSError):
                self.flush()
            found = None
        if found is None and SHIPPED.is_dir():
            with contextlib.suppress(Exception):
                found = self._load_shipped(sig, target_context)
        if found is None and not self._may_wait():
            raise NotCompiled
        return found

    def _load_shipped(self, sig: Any, target_context: Any) -> Any:
        """Load a kernel that was compiled for x86-64-v3, if this processor supports that.

        Versions of numba and Python, system, types and stamp must match as for local kernels. The compiler may not
        reorder arithmetic (no ``fastmath``), so results are the same bytes.
        """
        system, _, features = target_context.codegen().magic_tuple()
        available = {feature[1:] for feature in features.split(",") if feature.startswith("+")}
        if not _usual_settings() or not available >= NEEDED:
            return None
        folder = SHIPPED / Path(self._py_func.__code__.co_filename).resolve().parent.relative_to(PACKAGE)
        files = _CACHING.IndexDataCacheFile(
            str(folder), self._impl.filename_base, self._impl.locator.get_source_stamp()
        )
        data = files.load(self._index_key(sig, _MadeFor(system)))
        return None if data is None else self._impl.rebuild(target_context, data)


class _Implementation(_CACHING.CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, locator: _Place, function: Any) -> None:
        self._locator_classes = [locator]
        super().__init__(function)


class _Place:
    """numba's cache folder for a kernel, with a stamp of all that the kernel can reach.

    numba's own stamp is that of the kernel's file: an edited helper in another file would leave stale code, and an
    edited comment would recompile. Where no folder can be written (a read-only installation and home) it is a
    temporary one.
    """

    def __init__(self, chosen: Mapping[str, object]) -> None:
        self._options = chosen
        # the same function may be compiled as both
        self._kind = "inner" if _INNER.items() <= chosen.items() else "kernel"

    def from_function(self, function: Any, file: str) -> Any:
        usual = [] if _FOLDER in os.environ else _CACHING.CacheImpl._locator_classes
        found = (locator.from_function(function, file) for locator in usual)
        locator = next((locator for locator in found if locator is not None), None) or _temporary_place(function, file)
        # without line number and file time: a copied or checked-out tree keeps its compiled kernels
        locator.get_source_stamp = lambda: KernelStamp(function, self._options)
        locator.get_disambiguator = lambda: self._kind
        return locator


def _temporary_place(function: Any, file: str) -> Any:
    if _FOLDER not in os.environ:
        os.environ[_FOLDER] = tempfile.mkdtemp(prefix="assoc-numba-")
        # removed when this process ends
        temporary.add(os.environ[_FOLDER])
    locator = _IN_TREE(function, file)
    locator._cache_path = os.path.join(os.environ[_FOLDER], locator.get_suitable_cache_subpath(file))
    locator.ensure_cache_path()
    return locator


# how numba names what a kernel that calls itself refers to
_UNRESOLVED = ".numba.unresolved$"
NEEDED = {"avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "sse4.2", "xsave"}
"""The features of x86-64-v3, as LLVM names them."""


class _MadeFor:
    """Replaces the processor in numba's cache key by the one that shipped kernels were compiled for."""

    def __init__(self, system: str) -> None:
        self._system = system

    def magic_tuple(self) -> tuple[str, str, str]:
        return self._system, "x86-64-v3", ""


def _usual_settings() -> bool:
    """Whether numba has its default settings: for this processor, without checks, without Intel's library."""
    given = (_CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES, _CONFIG.BOUNDSCHECK)
    return given == (None, None, None) and not _CONFIG.USING_SVML and not _CONFIG.DEBUGINFO_DEFAULT


class _InnerLibrary(_CODEGEN.JITCodeLibrary):  # type: ignore[misc]
    """The code of an inner kernel, optimised and made into machine code only within the kernels that call it."""

    _final_module: Any

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        whole = self._final_module
        if not any(variable.name.startswith(_UNRESOLVED) for variable in whole.global_variables):
            # callers link the whole; this process has use for its variables alone
            self._finalized = True
            self._get_module_for_linking()
            self._finalized = False
            self._final_module = whole.clone()
            for function in self._final_module.functions:
                if not function.is_declaration:
                    function.linkage = "available_externally"
        super()._finalize_final_module()


class _Flags(_COMPILER.Flags):  # type: ignore[misc]
    """The options that a kernel is compiled with; what its numpy functions inherit of them is `_Inherited`."""

    def copy(self) -> Any:
        """Return the options by which numba finds numpy's functions, compiled for this kernel or another."""
        own = _Inherited(self)
        # what the wrappers of a kernel are does not matter to what it calls
        own.no_cpython_wrapper = own.no_cfunc_wrapper = True
        return _INHERITED.setdefault(own.summary(), own)


class _Inherited(_COMPILER.Flags):  # type: ignore[misc]
    """Options that never change, hashed once: numba does it at each call in a kernel, from all its options."""

    @functools.cached_property
    def _hash(self) -> int:
        return int(super().__hash__())

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or bool(super().__eq__(other))


# all that there are: the same options are one object, which is equal to itself at once
_INHERITED: dict[str, _Inherited] = {}


@_MACHINERY.register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(_PASSES.NativeLowering):  # type: ignore[misc]
    """numba's last step, by this package's `Lower`."""

    _name = "assoc_lowering"

    @property
    def lowering_class(self) -> Any:
        return Lower


class _Compiler(_COMPILER.Compiler):  # type: ignore[misc]
    """numba's compiler, whose tables find what a kernel calls by `_Inherited` options, and which lowers by `Lower`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags = _Flags(self.state.flags)

    def define_pipelines(self) -> Any:
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [
                (_Lowering if one is _PASSES.NativeLowering else one, text) for one, text in pipeline.passes
            ]
            pipeline.finalize()
        return pipelines


class _InnerCompiler(_Compiler):
    """The same with an `_InnerLibrary` for its results."""

    def __init__(self, typingctx: Any, targetctx: Any, *others: Any) -> None:
        super().__init__(typingctx, targetctx, *others)
        self.state.library = _InnerLibrary(targetctx.codegen(), "inner")
        self.state.library.enable_object_caching()


def _common(kind: Any) -> Any:
    """Return the type for which a kernel is compiled for whole numbers of any width from another kernel."""
    if isinstance(kind, (_TYPES.IntegerLiteral, _TYPES.BooleanLiteral)):
        kind = kind.literal_type
    if isinstance(kind, _TYPES.Integer) and kind.signed and kind.bitwidth < 64:
        return _TYPES.int64
    if type(kind) in (_TYPES.Tuple, _TYPES.UniTuple):
        return _TYPES.Tuple(tuple(map(_common, kind)))
    return kind


def _called_with_common_types(kernel: Any) -> Callable[..., Any]:
    """Resolve calls from kernels: by itself numba would compile anew for each literal number and each width."""
    call_template = kernel.get_call_template

    def template(args: Any, kws: Any) -> Any:
        return call_template(tuple(map(_common, args)), {name: _common(kind) for name, kind in dict(kws).items()})

    return template


class Draws(np.random.Generator):
    """A generator as kernels take it, of the same stream as another.

    For numba's own way to take one it calls Python. An exception of a signal handler there (Ctrl-C) ends the process by
    a segmentation fault, as numba goes on with what was not returned. Here all that can raise is done before the call.
    """

    def __init__(self, generator: np.random.Generator) -> None:
        super().__init__(generator.bit_generator)
        here: Any = generator.bit_generator.ctypes
        pointers = {name: ctypes.cast(getattr(here, name), ctypes.c_void_p).value for name in _FUNCTIONS}
        self.addresses = (here.state_address, here.state.value, *pointers.values())


_FUNCTIONS = ("next_uint64", "next_uint32", "next_double")


class _DrawsType(_TYPES.NumPyRandomGeneratorType):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__("assoc.Draws")
        self.name = "assoc.Draws"


_DRAWS = _DrawsType()
typeof_impl.register(Draws)(lambda value, context: _DRAWS)


@_EXTENDING.unbox(_DrawsType)  # type: ignore[untyped-decorator]
def _taken(kind: Any, given: Any, c: Any) -> Any:
    """The addresses, as numba's own struct of a generator; no reference is counted: the caller holds one."""
    generator = _CGUTILS.create_struct_proxy(kind)(c.context, c.builder)
    bits = _CGUTILS.create_struct_proxy(_TYPES.NumPyRandomBitGeneratorType("bit_generator"))(c.context, c.builder)
    addresses = c.pyapi.object_getattr_string(given, "addresses")
    for place, name in enumerate(("state_address", "state", *(f"fnptr_{name}" for name in _FUNCTIONS))):
        setattr(bits, name, c.unbox(_TYPES.uintp, c.pyapi.tuple_getitem(addresses, place)).value)
    c.pyapi.decref(addresses)
    bits.parent = generator.parent = given
    generator.bit_generator = bits._getvalue()
    return _EXTENDING.NativeValue(generator._getvalue())


_EXTENDING.register_model(_DrawsType)(NumPyRandomGeneratorTypeModel)
