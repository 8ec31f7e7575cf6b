"""Measurements in processes of their own, so that peak memory and processor time are those of one size."""

import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

Measured = dict[str, float]


def alone(measure: Callable[..., Measured], *arguments: Any) -> Measured:
    """Call a function of a module in a new process; what it returns, with ``peak`` in MB."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_measured, measure, arguments).result()


def _measured(measure: Callable[..., Measured], arguments: tuple[Any, ...]) -> Measured:
    return {**measure(*arguments), "peak": peak_mb()}


def peak_mb() -> float:
    """Return the most memory that this process has had."""
    status = Path("/proc/self/status")
    if status.exists():
        # Linux lets a child inherit the maximum that getrusage tells from the process that started it
        peak = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(peak.split()[1]) / 1e3
    import resource

    # bytes on macOS, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


@contextmanager
def seconds(found: Measured, name: str) -> Iterator[None]:
    """Write the processor time of a block, all threads, into what was found."""
    begin = time.process_time()
    yield
    found[name] = time.process_time() - begin
