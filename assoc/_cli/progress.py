"""The progress bar of the programs, with rate and remaining time; on a terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

from assoc._system.interrupts import end_is_asked

if TYPE_CHECKING:
    from assoc.sweeps.study import Counts

Item = TypeVar("Item")


class ProgressBar:
    """Shows progress on stderr, if that is a terminal: what is done (`label`), counted in `unit`, a plural."""

    def __init__(self, label: str, unit: str, shown: bool = True) -> None:
        self._unit = unit
        self.done = 0
        """Number of items that are done."""
        self._progress: Any = None
        self._started = time.perf_counter()
        if shown and sys.stderr.isatty():
            # imported here: slow, and only needed on a terminal
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                MofNCompleteColumn,
                Progress,
                TextColumn,
                TimeRemainingColumn,
            )

            self._progress = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(compact=True),
                TextColumn("left"),
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
        """Show the progress of a study."""
        self.show(counts.done, counts.total, counts.new)

    def say(self, line: str) -> None:
        """Print a line on stderr, above the bar."""
        if self._progress is None:
            print(line, file=sys.stderr, flush=True)
        else:
            self._progress.console.print(line, markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Remove the bar."""
        if self._progress is not None:
            self._progress.stop()

    def __enter__(self) -> ProgressBar:
        self._started = time.perf_counter()
        if self._progress is not None:
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def with_progress(items: Iterable[Item], total: int, bar: ProgressBar) -> Iterator[Item]:
    """Yield the items until the program is asked to end, and show how many are done."""
    with bar:
        bar.show(0, total, 0)
        for done, item in enumerate(items):
            bar.show(done, total, done)
            yield item
            bar.done = done + 1
            if end_is_asked():
                break
        else:
            bar.show(total, total, total)
