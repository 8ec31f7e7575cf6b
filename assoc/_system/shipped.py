"""Compiled kernels that came with the package: taken where they fit, so that nothing is compiled after installation.

A wheel may hold ``assoc/_kernels``: numba's own cache files, made by ``tests/release/kernels.py`` for x86-64-v3, which
is every x86-64 processor with AVX2. What numba's cache compares is compared here, too: numba's version, Python's, the
system, the types of the arguments, and the kernel's stamp (kernel_stamp.py). Only the processor need not be the same:
it must be able to do what x86-64-v3 can. Nothing allows the compiler other arithmetic (no ``fastmath``), so results
are the same bytes as those of a kernel compiled here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numba
from numba.core import caching

_PACKAGE = Path(__file__).resolve().parents[1]
FOLDER = _PACKAGE / "_kernels"

_CONFIG: Any = numba.config
_FILES: Any = caching.IndexDataCacheFile

NEEDED = {"avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "sse4.2", "xsave"}
"""What x86-64-v3 can do, in LLVM's words."""


class _Made:
    """Stands in numba's key for the processor: the one that the kernels were made for."""

    def __init__(self, system: str) -> None:
        self._system = system

    def magic_tuple(self) -> tuple[str, str, str]:
        return self._system, "x86-64-v3", ""


def load(cache: Any, signature: Any, target_context: Any) -> Any:
    """Return a kernel that was shipped, or None: it is compiled then.

    Parameters
    ----------
    cache : numba.core.caching.Cache
        The cache of the kernel, which has looked into its own files.
    signature : tuple of numba.types.Type
        Types of the arguments.
    target_context : numba.core.base.BaseContext
    """
    if not FOLDER.is_dir():
        return None
    codegen = target_context.codegen()
    system, _, features = codegen.magic_tuple()
    if not _usual_settings() or not NEEDED <= {one[1:] for one in features.split(",") if one.startswith("+")}:
        return None
    source = Path(cache._py_func.__code__.co_filename).resolve()
    folder = FOLDER / source.parent.relative_to(_PACKAGE)
    files = _FILES(str(folder), cache._impl.filename_base, cache._impl.locator.get_source_stamp())
    data = files.load(cache._index_key(signature, _Made(system)))
    return None if data is None else cache._impl.rebuild(target_context, data)


def _usual_settings() -> bool:
    """Whether numba compiles as it does by itself: for this processor, without checks, without Intel's library."""
    given = (_CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES, _CONFIG.BOUNDSCHECK)
    return given == (None, None, None) and not _CONFIG.USING_SVML and not _CONFIG.DEBUGINFO_DEFAULT
