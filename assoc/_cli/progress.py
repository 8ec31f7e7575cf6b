"""A progress bar with the rate and the time left, on a terminal only."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from assoc.sweeps.study import Counts


class Bar:
    """Shows `Counts` as they come.

    Parameters
    ----------
    stream : text file
        Where; nothing is shown if it is not a terminal.
    """

    def __init__(self, stream: TextIO) -> None:
        self._progress: Any = None
        self._started = time.perf_counter()
        if stream.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            self._progress = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[rate]}"),
                TimeRemainingColumn(compact=True),
                TextColumn("left"),
                console=Console(file=stream),
                transient=True,
            )
            self._task = self._progress.add_task("runs", total=None, rate="")

    def __call__(self, counts: Counts) -> None:
        """Show where the study is."""
        if self._progress is None:
            return
        rate = counts.new / max(time.perf_counter() - self._started, 1e-9)
        text = f"{rate:.3g} runs/s" if counts.new else ""
        self._progress.update(self._task, total=counts.total, completed=counts.done, rate=text)

    def close(self) -> None:
        """Take the bar away."""
        if self._progress is not None:
            self._progress.stop()

    def __enter__(self) -> Bar:
        self._started = time.perf_counter()
        if self._progress is not None:
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
