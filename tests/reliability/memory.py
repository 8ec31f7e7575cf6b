"""How much memory some work takes at its peak (Linux)."""

import contextlib
import ctypes
import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any


def resident(field: str = "VmRSS") -> int:
    """Bytes of memory of this process: VmRSS now, VmHWM at the most since `forget_peak`."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(f"{field}:"))


def forget_peak() -> None:
    """Count the peak from now on."""
    Path("/proc/self/clear_refs").write_text("5")


def tidy() -> None:
    """Give freed memory back to the system, so that it is not taken for memory in use."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def peak_of(work: Callable[[], Any]) -> tuple[Any, int]:
    """Do some work; its result, and how many bytes it took at the most more than there were before."""
    tidy()
    before = resident()
    forget_peak()
    result = work()
    return result, resident("VmHWM") - before
