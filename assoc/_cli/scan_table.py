"""A tracker's state after each of the first scans, as a table that grows; on a terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

from assoc._cli.lines import print_lines
from assoc._cli.table import GrowingTable
from assoc._system.compile_time import compile_seconds
from assoc._text.times import moment

if TYPE_CHECKING:
    from assoc.tracking import Tracker

Item = TypeVar("Item")

_SHOWN = 20
_HEADERS = ("scan", "time", "measurements", "tracks", "tentative", "ms")
_WIDTHS = {"time": 10, "ms": 8}


def with_scan_table(
    scans: Iterable[Item], tracker: Tracker, describe: Callable[[Item], tuple[float, Sequence[int]]]
) -> Iterator[Item]:
    """Yield the scans, and print a row for each of the first when the tracker has processed it.

    `describe` returns the time of a scan, in seconds, and its number of measurements for each sensor.
    """
    if not sys.stdout.isatty():
        yield from scans
        return
    table = GrowingTable(_HEADERS, _WIDTHS, (), _SHOWN)
    number = -1
    for number, scan in enumerate(scans):
        started, compiled = time.perf_counter(), compile_seconds()
        yield scan
        spent = time.perf_counter() - started - (compile_seconds() - compiled)
        if number < _SHOWN:
            at, sizes = describe(scan)
            reported = [track.reported for track in tracker.tracks]
            measurements = " ".join(map(str, sizes))
            cells = [str(number), moment(at), measurements, str(sum(reported)), str(reported.count(False))]
            table.add([[*cells, f"{1e3 * spent:.2f}"]])
    if number >= _SHOWN:
        print_lines(f"... and {number + 1 - _SHOWN} more scans")
