"""Runs grouped into batches that take about the same time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from assoc.sweeps.setting import Setting
from assoc.sweeps.worker import Batch, Result

RunNumbers = tuple[int, int, int, int]
"""Setting, source, repeat, scan; the first two as indices."""

MOST_RUNS = 2000


class Batches:
    """An iterator of batches of about so many seconds; it learns from results how long runs take.

    The grouping does not affect results.
    """

    def __init__(self, settings: Sequence[Setting], runs: Iterator[RunNumbers], seconds: float) -> None:
        self._settings = settings
        self._runs = runs
        self._seconds = seconds
        self._of_setting: dict[str, float] = {}
        self._of_solver: dict[str, float] = {}
        self._held: RunNumbers | None = None

    def __iter__(self) -> Iterator[Batch]:
        return self

    def __next__(self) -> Batch:
        chosen: list[RunNumbers] = []
        expected = 0.0
        while len(chosen) < MOST_RUNS:
            run = self._held or next(self._runs, None)
            self._held = None
            if run is None:
                break
            expected += self._expected(self._settings[run[0]])
            if chosen and expected > self._seconds:
                self._held = run
                break
            chosen.append(run)
        if not chosen:
            raise StopIteration
        local = {number: i for i, number in enumerate(dict.fromkeys(run[0] for run in chosen))}
        settings = tuple(self._settings[number] for number in local)
        return Batch(settings, [(local[run[0]], *run[1:]) for run in chosen])

    def _expected(self, setting: Setting) -> float:
        unknown = self._of_solver.get(setting.solver, self._seconds / 8)
        return self._of_setting.get(setting.key, unknown)

    def learn(self, result: Result) -> None:
        """Learn from the time of a batch; time outside the solvers is shared among its runs."""
        times = result.times()
        beside = max(0.0, result.seconds - sum(times)) / len(times)
        sums: dict[str, list[float]] = {}
        for row, seconds in zip(result.rows, times, strict=True):
            sums.setdefault(row[0], []).append(seconds + beside)
        for setting in result.batch.settings:
            mean = sum(sums[setting.key]) / len(sums[setting.key])
            self._of_setting[setting.key] = _mixed(self._of_setting.get(setting.key), mean)
            self._of_solver[setting.solver] = _mixed(self._of_solver.get(setting.solver), mean)


def _mixed(old: float | None, new: float) -> float:
    return new if old is None else (old + new) / 2
