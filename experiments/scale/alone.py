"""Measurements in processes of their own, so that peak memory and processor time are those of one size."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from experiments.benchmarks.scale import peak_mb

Measured = dict[str, float]


def alone(measure: Callable[..., Measured], *arguments: Any) -> Measured:
    """Call a function of a module in a new process; what it returns, with ``peak`` in MB."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_measured, measure, arguments).result()


def _measured(measure: Callable[..., Measured], arguments: tuple[Any, ...]) -> Measured:
    return {**measure(*arguments), "peak": peak_mb()}


@contextmanager
def seconds(found: Measured, name: str) -> Iterator[None]:
    """Write the processor time of a block, all threads, into what was found."""
    begin = time.process_time()
    yield
    found[name] = time.process_time() - begin
