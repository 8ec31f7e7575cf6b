"""What a tracker did with the plots of a recording, in the form that CT, MT and IT need."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from assoc._types import Array
from assoc.metrics import CtMtIt, ct_mt_it
from assoc.recordings import Recording, Window


class TakesWindows(Protocol):
    """A tracker of plots."""

    def take(self, window: Window) -> tuple[Array, Array]:
        """Take a window; return the track of each plot (-1: none) and whether it is confirmed then."""


@dataclass(frozen=True, eq=False)
class Taken:
    """Every plot that a tracker was given, in that order.

    windows, rows, tracks: int arrays (n,). The window's place in the list, the plot's row in the recording, the track
        that took it or -1.
    confirmed: bool array (n,).
    """

    windows: Array
    rows: Array
    tracks: Array
    confirmed: Array

    def rates(self, recording: Recording) -> CtMtIt:
        """CT, MT and IT with the sources that the simulation knows."""
        return ct_mt_it(self.windows, recording.sources[self.rows], self.tracks, self.confirmed)


def run(tracker: TakesWindows, windows: Sequence[Window]) -> Taken:
    """Give a tracker one window after the other."""
    parts = [tracker.take(window) for window in windows]
    sizes = [len(window) for window in windows]
    empty = [np.zeros(0, dtype=np.int64)]
    return Taken(
        np.repeat(np.arange(len(windows)), sizes),
        np.concatenate([window.rows for window in windows] or empty),
        np.concatenate([tracks for tracks, _ in parts] or empty),
        np.concatenate([sure for _, sure in parts] or empty).astype(bool),
    )
