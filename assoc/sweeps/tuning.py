"""A search for good parameters, with a report on seeds and scans that were held out."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
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
from assoc.sweeps.design import Range, Setting, Space
from assoc.sweeps.frame import load
from assoc.sweeps.sources import study_sources
from assoc.sweeps.store import REPORT, Store
from assoc.sweeps.study import Counts, Study
from assoc.sweeps.summary import MEASURES, paired

if TYPE_CHECKING:
    import pandas as pd


TARGETS = ("gap", "time")
PENALTY = 10.0
"""Factor of the cutoff that a run without optimum counts in "time" (PAR10)."""

_SCORED = ("cost", "lower_bound", "time")
_COMPARED = ("score", *MEASURES)


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
    sources: Any,
    solver: str,
    space: Mapping[str, Space],
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
    space : mapping
        Values or range of each parameter.
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
    for name, count in (("trials", trials), ("repeats", repeats)):
        if not is_whole(count, 1):
            raise InvalidInputError(f"{name}: expected a whole number >= 1, got {count!r}")
    sources = study_sources(sources)
    every = [range(source.num_scans) for source in sources] if scans is None else scans
    training, test, held_out = _split([list(numbers) for numbers in every], repeats)

    def study(*settings: Setting, last: bool = False) -> Study:
        seeds, chosen = (range(repeats, 2 * repeats), test) if last else (range(repeats), training)
        return Study(sources, settings, seeds, seed, time_limit, gating or {}, chosen, cpu_limit)

    where = {"jobs": jobs, "scheduler": scheduler}
    return _search(Path(folder), solver, space, trials, target, study, held_out, progress, where)


def _search(
    folder: Path,
    solver: str,
    space: Mapping[str, Space],
    trials: int,
    target: str,
    study: Callable[..., Study],
    held_out: str,
    progress: Callable[[Counts], object] | None,
    where: Mapping[str, Any],
) -> Report:
    fixed = {name: choice[0] for name, choice in space.items() if not isinstance(choice, Range) and len(choice) == 1}
    searched = {name: choice for name, choice in space.items() if name not in fixed}
    if not searched:
        raise InvalidInputError(f"--tune: nothing to tune for {solver!r}; give ranges in --grid, as in NAME=LOW:HIGH")
    optuna = load_extra("optuna", "tune")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    default = Setting(solver, fixed)
    first = study(default)
    total = Counts(first.size * trials + study(default, last=True).size * 2, 0)
    with Store(folder, first.manifest) as store:
        runs_of = partial(_runs_of, store, total, progress, where)
        known = runs_of(first)
        limit = first.time_limit or first.cpu_limit
        cutoff = limit if limit is not None else float(np.nanmax(known[2], initial=1e-6))

        def setting_of(trial: Any) -> Setting:
            return Setting(solver, fixed | {name: _suggest(trial, name, choice) for name, choice in searched.items()})

        def score(trial: Any) -> float:
            return float(scores(*runs_of(study(setting_of(trial))), target, cutoff).mean())

        search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=first.seed))
        usual = default.parameters
        search.enqueue_trial({name: usual[name] for name, choice in searched.items() if usual[name] in choice})
        search.optimize(score, n_trials=trials)
        tuned = setting_of(search.best_trial)
        last = study(default, tuned, last=True)
        runs_of(last)
    held = load(folder)
    keys, seeds = zip(*((key[0], key[2]) for key in map(last.key, last.all_runs())), strict=True)
    held = held[held["setting"].isin(keys) & held["repeat"].isin(seeds)]
    cost, bound, time = (held[name].to_numpy(dtype=float) for name in _SCORED)
    table = paired(held.assign(score=scores(cost, bound, time, target, cutoff)), tuned.key, default.key, _COMPARED)
    trained = float(scores(*known, target, cutoff).mean()), float(search.best_value)
    report = Report(solver, target, trials, tuned, default, trained, table, held_out)
    _save(folder / REPORT, report)
    return report


def _runs_of(
    store: Store,
    total: Counts,
    progress: Callable[[Counts], object] | None,
    where: Mapping[str, Any],
    study: Study,
) -> tuple[Floats, Floats, Floats]:
    """Costs, bounds and times of the runs of a study, done where the folder lacks them."""
    before = total.before, total.new

    def shown(counts: Counts) -> None:
        total.before, total.new = before[0] + counts.before, before[1] + counts.new
        total.total = max(total.total, sum(before) + counts.total)
        if progress is not None:
            progress(total)

    study.run(store, **where, progress=shown)
    query = f"setting, source, repeat, scan, {', '.join(_SCORED)} FROM runs WHERE setting = ?"
    known = {row[:4]: row[4:] for one in study.settings for row in store.select(query, (one.key,))}
    cost, bound, time = np.array([known[study.key(run)] for run in study.all_runs()], dtype=float).T
    return cost, bound, time


def _split(scans: list[list[int]], repeats: int) -> tuple[list[list[int]], list[list[int]], str]:
    """Scans for training and for the report."""
    if sum(map(len, scans)) < 4 or all(len(numbers) < 2 for numbers in scans):
        return scans, scans, f"seeds {repeats} to {2 * repeats - 1} on the same problems"
    parts = (
        [numbers if len(numbers) < 2 else numbers[::2] for numbers in scans],
        [numbers if len(numbers) < 2 else numbers[1::2] for numbers in scans],
    )
    return (*parts, f"scans that training did not see, with seeds {repeats} to {2 * repeats - 1}")


def _suggest(trial: Any, name: str, space: Space) -> Any:
    if not isinstance(space, Range):
        return trial.suggest_categorical(name, list(space))
    if space.whole:
        return trial.suggest_int(name, int(space.low), int(space.high), log=space.logarithmic)
    return trial.suggest_float(name, space.low, space.high, log=space.logarithmic)


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
