"""The one way to numba: lazy signatures, cached on disk, without the GIL, also where no cache can be written."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any


def _cache_is_writable() -> bool:
    """Whether numba can keep its cache beside this package (its first choice) or where the user told it to."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return True
    folder = Path(__file__).parent
    probe = folder / "__pycache__" if (folder / "__pycache__").is_dir() else folder
    return os.access(probe, os.W_OK)


if not _cache_is_writable():
    # numba would fail at import ("no locator available") where neither the package nor the home can be written
    os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="assoc-numba-")

import numba  # noqa: E402  (the environment above must be set first)


def njit(function: Callable[..., Any]) -> Any:
    """Compile a kernel: ``numba.njit`` with ``cache=True, nogil=True`` and ``error_model="numpy"``."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)
