"""The progress bar of the programs, with the rate and the time left; on a terminal only."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

from assoc._system.compile_time import is_compiling

if TYPE_CHECKING:
    from assoc.solution import TracePoint
    from assoc.sweeps.study import Counts

Item = TypeVar("Item")

_EVERY = 5.0
# seconds of compiling that need no words
_SOON = 0.5
# seconds after which a scan is slow enough to say how far it is
_SLOW = 1.0


class SoFar:
    """What a solver has found of the scan that it is at, in words for the progress bar."""

    def __init__(self) -> None:
        self.next_scan()

    def next_scan(self) -> None:
        """Begin a scan."""
        self._words = ""
        self._began = time.monotonic()

    def note(self, point: TracePoint) -> None:
        """Take in a point of the solver's trace."""
        if math.isfinite(point.cost):
            self._words = f"cost {point.cost:.6g}, gap {max(point.cost - point.lower_bound, 0.0):.2g} so far"

    def __str__(self) -> str:
        return self._words if time.monotonic() - self._began > _SLOW else ""


class ProgressBar:
    """Shows on stderr how much is done; nothing if that is not a terminal.

    Parameters
    ----------
    label : str
        What the program is doing.
    unit : str
        What it counts, in the plural.
    shown : bool, default True
        Show nothing at all otherwise.
    so_far : SoFar, optional
        What is said of a scan that takes long.
    """

    def __init__(self, label: str, unit: str, shown: bool = True, so_far: SoFar | None = None) -> None:
        self._unit = unit
        self._progress: Any = None
        self._started = time.perf_counter()
        if shown and sys.stderr.isatty():
            # needed on a terminal alone, and slow to load
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                ProgressColumn,
                Task,
                TextColumn,
                TimeRemainingColumn,
            )
            from rich.text import Text

            class Compiling(ProgressColumn):
                """Says how far a scan is that takes long, and why the first ones do."""

                def render(self, task: Task) -> Text:
                    compiling = "compiling, once after installation" if is_compiling(_SOON) else ""
                    return Text("; ".join(filter(None, [str(so_far or ""), compiling])))

            self._progress = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(compact=True),
                TextColumn("left"),
                Compiling(),
                console=Console(file=sys.stderr),
                transient=True,
            )
            self._task = self._progress.add_task(label, total=None, rate="")

    def show(self, done: int, total: int, new: int) -> None:
        """Show that ``done`` of ``total`` are done, ``new`` of them since the bar began."""
        if self._progress is None:
            return
        rate = new / max(time.perf_counter() - self._started, 1e-9)
        text = f"{rate:.3g} {self._unit}/s" if new else ""
        self._progress.update(self._task, total=total, completed=done, rate=text)

    def __call__(self, counts: Counts) -> None:
        """Show where a study is."""
        self.show(counts.done, counts.total, counts.new)

    def close(self) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()

    def __enter__(self) -> ProgressBar:
        self._started = time.perf_counter()
        if self._progress is not None:
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class ProgressLog:
    """Says on stderr every five seconds where a study is: for those who read it in a file.

    Parameters
    ----------
    silent : bool
        Say nothing.
    """

    def __init__(self, silent: bool) -> None:
        self._next = float("inf") if silent else 0.0

    def __call__(self, counts: Counts) -> None:
        """Say where a study is."""
        if time.monotonic() >= self._next or (counts.done == counts.total and self._next < float("inf")):
            self._next = time.monotonic() + _EVERY
            print(f"{counts.done} of {counts.total} runs", file=sys.stderr, flush=True)


def with_progress(
    items: Iterable[Item], total: int, label: str, *, shown: bool = True, so_far: SoFar | None = None
) -> Iterator[Item]:
    """Yield the items, scans or what makes them, and show a progress bar while they are worked on."""
    with ProgressBar(label, "scans", shown, so_far) as bar:
        bar.show(0, total, 0)
        for done, item in enumerate(items):
            bar.show(done, total, done)
            yield item
            if so_far is not None:
                so_far.next_scan()
        bar.show(total, total, total)
