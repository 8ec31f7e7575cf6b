"""Where numba keeps an inner kernel: linked into the kernels that call it, and optimised and translated there alone.

numba optimises and translates every kernel on its own, links it into those that call it, and does all of it again with
the whole. Nobody calls an inner kernel by itself, so that the first time is in vain: nearly a third of the time that
branch and bound takes to compile.
"""

from __future__ import annotations

from typing import Any

from numba.core import codegen, compiler, environment

_LIBRARY: Any = codegen.JITCodeLibrary
_CODEGEN: Any = codegen.JITCPUCodegen
_COMPILER: Any = compiler.Compiler
_lookup_environment: Any = environment.lookup_environment

# how numba tells on disk what it keeps of a kernel; its own kinds are "object" and "bitcode"
_KIND = "inner"
# how the names of environments begin: what a kernel holds of Python, for its exceptions
_ENVIRONMENT = "_ZN08NumbaEnv"


class _InnerLibrary(_LIBRARY):  # type: ignore[misc]
    """The code of an inner kernel, which others link; no address in memory."""

    def _optimize_final_module(self) -> None:
        """Leave it to those that call it."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """0: what is not there."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """What is kept on disk, as of other kernels: machine code, here none, and what others link."""
        self._ensure_finalized()
        return self.name, _KIND, (b"", self._final_module.as_bitcode())


class InnerCompiler(_COMPILER):  # type: ignore[misc]
    """numba's compiler, which puts what it makes into an `_InnerLibrary`."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *others: Any) -> None:
        super().__init__(typingctx, targetctx, library, *others)
        self.state.library = _InnerLibrary(targetctx.codegen(), _KIND)
        self.state.library.enable_object_caching()


_finalize_specific = _LIBRARY._finalize_specific
_set_env = _CODEGEN.set_env
_unserialize_library = _CODEGEN.unserialize_library


def _with_environments(library: Any) -> None:
    """Translate a kernel, and set the environments of the inner ones in it: only now they have an address."""
    _finalize_specific(library)
    for value in library._final_module.global_variables:
        held = _lookup_environment(value.name) if value.name.startswith(_ENVIRONMENT) else None
        if held is not None:
            library.codegen.set_env(value.name, held)


def _set_where_present(self: Any, name: str, held: Any) -> None:
    if self._engine.get_global_value_address(name):
        _set_env(self, name, held)


def _unserialized(self: Any, state: tuple[str, str, Any]) -> Any:
    name, kind, code = state
    if kind != _KIND:
        return _unserialize_library(self, state)
    library = _InnerLibrary(self, name)
    _, bitcode = code
    library._final_module = codegen.ll.parse_bitcode(bitcode)  # type: ignore[attr-defined]
    library._finalize_final_module()
    return library


_LIBRARY._finalize_specific = _with_environments
_CODEGEN.set_env = _set_where_present
_CODEGEN.unserialize_library = _unserialized
