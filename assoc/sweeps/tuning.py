"""A search for good parameters, with a report on seeds and scans that were held out."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_text
from assoc._files.reading import check_regular
from assoc._parameters import is_whole
from assoc._system.imports import load_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Floats
from assoc.errors import InvalidInputError
from assoc.solution import OPTIMALITY_TOLERANCE
from assoc.solvers import registry
from assoc.sweeps.comparison import paired
from assoc.sweeps.frame import load
from assoc.sweeps.setting import Setting, parameter
from assoc.sweeps.sources import StudySource, study_sources
from assoc.sweeps.space import Range, Space, Values
from assoc.sweeps.store import REPORT, Store
from assoc.sweeps.study import Counts, Study
from assoc.sweeps.summary import MEASURES

if TYPE_CHECKING:
    import pandas as pd


TARGETS = ("gap", "time")
PENALTY = 10.0
"""Factor of the cutoff that a run without optimum counts in "time" (PAR10)."""

_WIDTH = 4.0
_SCORED = ("cost", "lower_bound", "time")
# a larger value of these never worsens the gap: they are a budget, not something to tune
_BUDGETS = ("iterations", "patience", "nodes", "workers")


@dataclass(frozen=True)
class Report:
    """The result of a search."""

    solver: str
    target: str
    trials: int
    tuned: Setting
    default: Setting
    training: tuple[float, float]
    """Target of default and tuned setting on the training runs."""
    table: pd.DataFrame
    """Tuned and default setting on the held-out runs, as from `assoc.sweeps.compare`; ``score`` is the target."""
    held_out: str
    """Description of the held-out runs."""


@explains_wrong_types
def tune(
    folder: str | os.PathLike[str],
    sources: Sequence[StudySource],
    solver: str,
    space: Mapping[str, Space] | None = None,
    trials: int = 100,
    *,
    target: str = "gap",
    repeats: int = 3,
    seed: int = 0,
    time_limit: float | None = None,
    cpu_limit: float | None = None,
    gating: Mapping[str, Any] | None = None,
    scans: Sequence[Sequence[int]] | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[Counts], object] | None = None,
) -> Report:
    """Search the parameters of a solver with optuna's tree-structured Parzen estimator.

    All runs are saved in the folder as those of a study; the same call again continues where it was stopped.

    Parameters
    ----------
    folder : path-like
    sources : Scene, AssignmentProblem, or sequence of them
    solver : str
    space : mapping, optional
        Values or range of each parameter; by default a quarter of each number's default to four times it.
    trials : int, default 100
        Number of settings to try; the first is the default if the space contains it.
    target : str, default "gap"
        "gap": mean gap. "time": mean time, where a run without certified optimum counts ten times the cutoff:
        the time limit, or by default the longest training run of the default setting.
    repeats : int, default 3
        Seeds for the training of a setting; as many others are held out. With four scans or more, training uses only
        the even ones, and the others are held out too.
    seed, time_limit, cpu_limit, gating, scans, jobs, scheduler, progress
        As in `Study`.

    Returns
    -------
    Report
        Also written to ``tuning.json`` in the folder.

    Raises
    ------
    InvalidInputError
        There is nothing to tune, optuna is missing, or as for `Study`.
    """
    if target not in TARGETS:
        raise InvalidInputError(f"target: expected gap or time, got {target!r}")
    _require_counts(trials=trials, repeats=repeats)
    optuna, ranges = load_extra("optuna", "tune"), _ranges(solver, space)
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    sources = study_sources(sources)
    every = [range(source.num_scans) for source in sources] if scans is None else scans
    training, test, words = _split([list(numbers) for numbers in every], repeats)

    def study(settings: Sequence[Setting], held_out: bool = False) -> Study:
        seeds = range(repeats, 2 * repeats) if held_out else range(repeats)
        return Study(
            sources, settings, seeds, seed, time_limit, gating or {}, test if held_out else training, cpu_limit
        )

    default = _default(solver, ranges)
    size = study([default]).size * trials + study([default], held_out=True).size * 2
    with Store(folder, study([default]).manifest) as store:
        runs = _Runs(store, size, progress, {"jobs": jobs, "scheduler": scheduler})
        first = runs.of(study([default]))
        limit = time_limit if time_limit is not None else cpu_limit
        cutoff = limit if limit is not None else float(np.nanmax(first[2], initial=1e-6))

        def setting(trial: Any) -> Setting:
            return Setting(solver, {name: _suggest(trial, name, choice) for name, choice in ranges.items()})

        search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=seed))
        search.enqueue_trial(_point(default, ranges))
        search.optimize(lambda trial: _score(runs.of(study([setting(trial)])), target, cutoff), n_trials=trials)
        tuned = setting(search.best_trial)
        training_scores = _score(first, target, cutoff), float(search.best_value)
        last = study([default, tuned], held_out=True)
        runs.of(last)
    held = _frame(folder, last)
    cost, bound, time = (held[name].to_numpy(dtype=float) for name in _SCORED)
    held = held.assign(score=scores(cost, bound, time, target, cutoff))
    table = paired(held, tuned.key, default.key, ("score", *MEASURES))
    report = Report(solver, target, trials, tuned, default, training_scores, table, words)
    _save(Path(folder) / REPORT, report)
    return report


def _require_counts(**given: object) -> None:
    for name, count in given.items():
        if not is_whole(count, 1):
            raise InvalidInputError(f"{name}: expected a whole number >= 1, got {count!r}")


def _ranges(solver: str, space: Mapping[str, Space] | None) -> dict[str, Space]:
    ranges = dict(space) if space else default_space(solver)
    if not any(isinstance(choice, Range) or len(choice.values) > 1 for choice in ranges.values()):
        raise InvalidInputError(f"--tune: solver {solver!r} has nothing to tune here; give ranges in --grid")
    return ranges


def _default(solver: str, ranges: Mapping[str, Space]) -> Setting:
    """The default setting, but for parameters that have a single value here."""
    single = {name: choice.values for name, choice in ranges.items() if isinstance(choice, Values)}
    return Setting(solver, {name: values[0] for name, values in single.items() if len(values) == 1})


def _split(scans: list[list[int]], repeats: int) -> tuple[list[list[int]], list[list[int]], str]:
    """Scans for training and for the report."""
    if sum(map(len, scans)) < 4 or all(len(numbers) < 2 for numbers in scans):
        return scans, scans, f"seeds {repeats} to {2 * repeats - 1} on the same problems"
    parts = (
        [numbers if len(numbers) < 2 else numbers[::2] for numbers in scans],
        [numbers if len(numbers) < 2 else numbers[1::2] for numbers in scans],
    )
    return (*parts, f"scans that training did not see, with seeds {repeats} to {2 * repeats - 1}")


def default_space(solver: str) -> dict[str, Space]:
    """Ranges around the defaults of a solver's numbers, within the solver's limits."""
    found: dict[str, Space] = {}
    kind: Any = registry.parameters(solver)
    for item in fields(kind):
        value: Any = item.default
        if item.name in _BUDGETS or type(value) not in (int, float) or value <= 0:
            continue
        option = parameter(solver, item.name)
        low = _furthest(solver, item.name, value, value / _WIDTH)
        high = _furthest(solver, item.name, value, value * _WIDTH)
        if option.kind is int:
            low, high = max(1, round(low)), round(high)
        if low < high:
            found[item.name] = Range(low, high, logarithmic=True, whole=option.kind is int)
    return found


def _furthest(solver: str, name: str, good: float, wanted: float) -> float:
    """The value nearest to ``wanted`` that the solver accepts."""
    whole = isinstance(good, int)

    def taken(value: float) -> bool:
        try:
            Setting(solver, {name: round(value) if whole else value})
        except InvalidInputError:
            return False
        return True

    if taken(wanted):
        return wanted
    bad = wanted
    for _ in range(20):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if taken(middle) else (good, middle)
    # four digits, and not beyond the limit
    rounded = float(f"{good:.4g}")
    return rounded if taken(rounded) else good


def _suggest(trial: Any, name: str, space: Space) -> Any:
    if isinstance(space, Values):
        return space.values[0] if len(space.values) == 1 else trial.suggest_categorical(name, list(space.values))
    if space.whole:
        return trial.suggest_int(name, int(space.low), int(space.high), log=space.logarithmic)
    return trial.suggest_float(name, space.low, space.high, log=space.logarithmic)


def _point(default: Setting, space: Mapping[str, Space]) -> dict[str, Any]:
    """The default values as the first trial, as far as the space contains them."""
    point = {}
    for name, choice in space.items():
        value = default.parameters[name]
        if isinstance(choice, Range):
            if choice.low <= value <= choice.high:
                point[name] = value
        elif len(choice.values) > 1 and value in choice.values:
            point[name] = value
    return point


class _Runs:
    """The runs of studies, done where the folder lacks them: cost, bound and time of each.

    All studies together have about `size` runs; `progress` gets their `Counts` so far, `where` says where runs are
    done.
    """

    def __init__(
        self, store: Store, size: int, progress: Callable[[Counts], object] | None, where: Mapping[str, Any]
    ) -> None:
        self._store, self._size, self._progress, self._where = store, size, progress, where
        self._total = Counts(0, 0)

    def of(self, study: Study) -> tuple[Floats, Floats, Floats]:
        """Costs, bounds and times of the runs of a study, NaN where there are none."""
        total, before = self._total, replace(self._total)

        def shown(counts: Counts) -> None:
            total.total = max(before.done + counts.total, self._size)
            total.before, total.new = before.before + counts.before, before.new + counts.new
            if self._progress is not None:
                self._progress(total)

        study.run_in(self._store, **self._where, progress=shown)
        query = f"setting, source, repeat, scan, {', '.join(_SCORED)} FROM runs WHERE setting = ?"
        known = {row[:4]: row[4:] for one in study.settings for row in self._store.select(query, (one.key,))}
        cost, bound, time = np.array([known[key] for key in study.keys()], dtype=float).T
        return cost, bound, time


def _frame(folder: str | os.PathLike[str], study: Study) -> pd.DataFrame:
    """The runs of a study as a table."""
    frame = load(folder)
    keys = [setting.key for setting in study.settings]
    return frame[frame["setting"].isin(keys) & frame["repeat"].isin({key[2] for key in study.keys()})].reset_index(
        drop=True
    )


def _score(runs: tuple[Floats, Floats, Floats], target: str, cutoff: float) -> float:
    return float(scores(*runs, target, cutoff).mean())


def scores(cost: Floats, bound: Floats, time: Floats, target: str, cutoff: float) -> Floats:
    """Target of each run; lower is better. A run without a solution counts as a very bad one."""
    gap = cost - bound
    if target == "gap":
        return np.where(np.isfinite(gap), gap, 1e6)
    optimal = gap <= OPTIMALITY_TOLERANCE * np.maximum(1.0, np.abs(cost))
    return np.where(optimal, np.minimum(time, PENALTY * cutoff), PENALTY * cutoff)


def _save(path: Path, report: Report) -> None:
    content = {
        "format": "assoc.tuning",
        "version": 2,
        "solver": report.solver,
        "target": report.target,
        "trials": report.trials,
        "tuned": dict(report.tuned.parameters),
        "default": dict(report.default.parameters),
        "training": dict(zip(("default", "tuned"), report.training, strict=True)),
        "held_out": report.held_out,
        "table": report.table.to_dict("records"),
    }
    check_regular(path)
    write_text(path, json.dumps(content, indent=1) + "\n")
