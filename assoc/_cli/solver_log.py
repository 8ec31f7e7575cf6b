"""A solver's progress on a scan: below the progress bar, and as lines with ``-v``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._cli.progress import ProgressBar
from assoc.solution import Solution, TracePoint

if TYPE_CHECKING:
    from assoc.association.scan import ScanAssociation

# seconds between two lines, and before the progress of a scan is shown
_EVERY = 0.5
_HEADERS = f"{'scan':>6} {'seconds':>9} {'iteration':>10} {'cost':>14} {'bound':>14} {'gap':>10}"


class SolverLog:
    """Shows cost, bound and gap of the current scan as the bar's note; `verbose`: as thinned out lines, too."""

    def __init__(self, bar: ProgressBar, verbose: bool) -> None:
        self._bar = bar
        self._verbose = verbose
        self._headed = False
        self._said = 0.0

    def __call__(self, scan: int, point: TracePoint) -> None:
        """Show a point in the history of a scan."""
        if point.seconds < _EVERY:
            self._said = 0.0
            return
        gap = point.cost - point.lower_bound
        self._bar.note = f"scan {scan}: cost {point.cost:.6g}, bound {point.lower_bound:.6g}, gap {gap:.3g}"
        if point.seconds - self._said >= _EVERY:
            self._said = point.seconds
            self._line(scan, point)

    def end(self, done: ScanAssociation) -> None:
        """Show the association of a scan, or the best one of a ranking."""
        found = done.solution
        self._bar.note, self._said = "", 0.0
        last = TracePoint(found.iterations, found.runtime, found.cost, found.lower_bound)
        self._line(done.scan, last, _ending(found))

    def _line(self, scan: int, point: TracePoint, ending: str = "") -> None:
        if not self._verbose:
            return
        if not self._headed:
            self._headed = True
            self._bar.say(_HEADERS)
        gap = point.cost - point.lower_bound
        self._bar.say(
            f"{scan:>6} {point.seconds:>9.3f} {point.iteration:>10} {point.cost:>14.4f} {point.lower_bound:>14.4f} "
            f"{gap:>10.3g}{ending}"
        )


def _ending(solution: Solution) -> str:
    return f"  {solution.status}" if solution.status == "optimal" else f"  {solution.status} ({solution.stopped_by})"
