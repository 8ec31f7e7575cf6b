"""Work spread over the workers of a dask.distributed scheduler."""

from __future__ import annotations

import queue
import sys
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Any

from assoc.errors import AssocError, InvalidInputError

_LOST = "--scheduler: the connection is lost"
_ATTEMPTS = 5
_ITEMS_PER_THREAD = 3


class LostError(InvalidInputError):
    """The scheduler is lost, or workers were lost again and again."""


def connect(address: str, timeout: float = 10.0) -> Any:
    """Connect to a scheduler, which must answer within ``timeout`` seconds."""
    try:
        from distributed import Client
    except ImportError:
        raise InvalidInputError(
            "--scheduler: needs dask.distributed, which is not installed: python -m pip install 'assoc[dask]'"
        ) from None
    _quiet()
    try:
        client: Any = Client
        return client(address, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InvalidInputError(f"--scheduler: no scheduler answers at {address} ({reason})") from None


def _quiet() -> None:
    """Keep distributed from logging lost connections to stderr: the package prints one line instead."""
    import logging

    for name in ("distributed", "distributed.client", "distributed.comm", "distributed.core", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)


class _Workers:
    """The workers of a scheduler, for one task."""

    def __init__(self, client: Any, task: Callable[[Any], Any]) -> None:
        self._client = client
        self._task = task
        self._shared: Any = None
        self._finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._running: dict[Any, tuple[Any, int]] = {}

    def map(self, items: Iterator[Any]) -> Iterator[Any]:
        """Yield the results of the items as they arrive."""
        self._wait_for_workers()
        self._share()
        left = True
        while left or self._running:
            while left and len(self._running) < self._room():
                item = next(items, None)
                if item is None:
                    left = False
                else:
                    self._submit(item, 1)
            try:
                future = self._finished.get(timeout=1.0)
            except queue.Empty:
                self._check_scheduler()
                continue
            yield from self._results_of(future)

    def _room(self) -> int:
        return _ITEMS_PER_THREAD * max(1, sum(self._client.nthreads().values()))

    def _share(self) -> None:
        self._shared = self._client.scatter(self._task, broadcast=True, hash=False)

    def _submit(self, item: Any, attempt: int) -> None:
        future = self._client.submit(_call, self._shared, item, pure=False)
        self._running[future] = item, attempt
        future.add_done_callback(self._finished.put)

    def _results_of(self, future: Any) -> Iterator[Any]:
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        item, attempt = self._running.pop(future)
        try:
            yield future.result()
        except AssocError:
            raise
        except (FutureCancelledError, KilledWorker) as error:
            # the workers that held the task are lost, or the item killed them
            if attempt == _ATTEMPTS:
                raise LostError(
                    f"--scheduler: {attempt} attempts at a batch ended with the loss of workers "
                    f"({' '.join(str(error).split())[:160]})"
                ) from None
            self._check_scheduler()
            self._wait_for_workers()
            if self._shared.status != "finished":
                self._share()
            self._submit(item, attempt + 1)
        except Exception as error:
            # for example a worker that cannot import this package
            self._check_scheduler()
            raise InvalidInputError(
                f"--scheduler: a worker failed: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
            ) from None

    def _check_scheduler(self) -> None:
        if self._client.status != "running":
            raise LostError(_LOST)

    def _wait_for_workers(self) -> None:
        announced = False
        while not self._client.nthreads():
            self._check_scheduler()
            if not announced:
                print("assoc: the scheduler has no workers yet; waiting for one", file=sys.stderr)
                announced = True
            time.sleep(0.2)


def _call(task: Callable[[Any], Any], item: tuple[int, Any]) -> tuple[int, Any]:
    return item[0], task(item[1])


def dask_map(task: Callable[[Any], Any], items: Iterable[Any], address: str, *, ordered: bool = True) -> Generator[Any]:
    """Yield ``task(item)`` for each item, from the workers of the scheduler at ``address``; see `engine.parallel_map`.

    The task is sent to every worker once. Workers may come and go: the items of a lost worker are repeated by another.
    `LostError` if the connection is lost, or workers in several attempts at an item.
    """
    client = connect(address)
    arrived: dict[int, Any] = {}
    given = 0
    try:
        for number, value in _Workers(client, task).map(enumerate(items)):
            arrived[number if ordered else given] = value
            while given in arrived:
                yield arrived.pop(given)
                given += 1
    except OSError:  # includes timeouts and closed connections
        raise LostError(_LOST) from None
    finally:
        client.close(timeout=2)
