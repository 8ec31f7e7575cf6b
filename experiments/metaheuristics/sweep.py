"""What alpha, beta, rho, the number of ants and the refinement do where problems are not easy.

On the ant colony paper's own scene every setting finds every optimum, so that its table 1 says nothing of solutions.
Here are the same scene with noise of 200 m and ten times the false alarms ("noisy radars"; still easy: greedy finds
every optimum), with noise of 4 km and thirty times the false alarms ("poor radars"), and scenes of three bearing-only
sensors full of ghosts. All 54 settings of alpha 0, 1, 2, beta 1, 2, 4, rho 0.3, 0.9 and 5, 15, 45 ants run
on the same problems: mode "paper" until all ants walk the same tour (150 cycles at the most), mode "mmas" with
refinement="none" until 900 ants have walked, with refinement="full" for three cycles. So all have an effort that
does not depend on the machine. A figure is the mean excess over the optimum in percent; intervals are 95 %, from
resampling problems. The best setting is chosen on every second problem, and judged on the others.
"""

import itertools
import tempfile
from collections.abc import Sequence
from typing import Any
from unittest import mock

import numpy as np

import assoc
from assoc._types import Floats
from assoc.problem import AssignmentProblem
from assoc.solvers import improve
from assoc.sweeps import Setting, Study, load
from assoc.sweeps.bootstrap import mean_interval
from assoc.sweeps.sources import StudySource
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.results import Results
from experiments.metaheuristics.problems import problem
from experiments.metaheuristics.running import UNLIMITED

NAME = "metaheuristics.sweep"
GRID: dict[str, tuple[float, ...]] = {
    "alpha": (0.0, 1.0, 2.0), "beta": (1.0, 2.0, 4.0), "rho": (0.3, 0.9), "ants": (5, 15, 45)
}  # fmt: skip
ADVICE = {"alpha": 2.0, "beta": 1.0, "rho": 0.3, "ants": 15}
"""What table 1 of the paper ends with, and the defaults of `AcoParameters`."""
SURFACES = (("alpha", "beta"), ("rho", "ants"))
HOW = ("paper", "mmas, none", "mmas, full")
PROBLEMS = {"noisy radars": 20, "poor radars": 20, "ghosts 20": 12, "ghosts 40": 12}
"""Names in problems.py, and how many."""
_WALKS = 900


def settings() -> list[dict[str, Any]]:
    """All settings, in the order of the arrays."""
    made = [dict(zip(GRID, values, strict=True)) for values in itertools.product(*GRID.values())]
    return [setting | {"ants": int(setting["ants"])} for setting in made]


def _setting(how: str, values: dict[str, Any]) -> Setting:
    if how == "paper":
        return Setting("aco", {"mode": "paper", "iterations": 150, **values})
    refinement = how.removeprefix("mmas, ")
    cycles = 3 if refinement == "full" else _WALKS // values["ants"]
    return Setting("aco", {**values, "refinement": refinement, "iterations": cycles, "patience": UNLIMITED})


def excesses(how: str, problems: Sequence[AssignmentProblem], optima: Floats, seed: int) -> Floats:
    """Excess of every setting on every problem, percent."""
    made = [_setting(how, values) for values in settings()]
    sources = [StudySource(instance, f"{number:03d}") for number, instance in enumerate(problems)]
    # what an answer proves is not asked for: it would take longer than the ants
    without = mock.patch.object(improve, "close", lambda component, run: None)
    with tempfile.TemporaryDirectory(prefix="assoc-") as folder, without:
        Study(sources, made, 1, seed).run(folder)
        frame = load(folder)
    costs = frame.pivot(index="setting", columns="scene", values="cost").loc[[setting.key for setting in made]]
    return 100.0 * (costs.to_numpy(dtype=float) - optima) / np.abs(optima)


def claims_of(name: str, excess: Floats) -> list[Claim]:
    """The claims of one kind of problem and search; excess (settings, problems)."""
    every = settings()
    found = []
    for names in SURFACES:
        for values in itertools.product(*(GRID[name] for name in names)):
            chosen = [all(setting[n] == v for n, v in zip(names, values, strict=True)) for setting in every]
            words = ", ".join(f"{name} {value:g}" for name, value in zip(names, values, strict=True))
            found.append(_mean(f"{name}: {words}", excess[chosen].mean(axis=0)))
    train, test = excess[:, ::2], excess[:, 1::2]
    best, advice = int(train.mean(axis=1).argmin()), every.index(ADVICE)
    words = " ".join(f"{name} {value:g}" for name, value in every[best].items())
    return [
        *found,
        _mean(f"{name}: best setting, {words}", test[best]),
        _mean(f"{name}: table 1's advice", test[advice]),
        _mean(f"{name}: table 1's advice less the best setting", test[advice] - test[best]),
        _mean(f"{name}: worst setting", excess[int(excess.mean(axis=1).argmax())]),
    ]


def _mean(quantity: str, values: Floats) -> Claim:
    return Claim(quantity, "%", None, float(values.mean()), mean_interval(values[:, None]))


def draw(figure: Any, kind: str) -> None:
    """Draw the published surfaces of one kind of problem."""
    claims = Results(NAME)
    figure.set_size_inches(9.0, 3.2 * len(HOW))
    for row, how in zip(figure.subplots(len(HOW), 2), HOW, strict=True):
        for ax, (up, across) in zip(row, SURFACES, strict=True):
            found = [[claims[f"{kind}, {how}: {up} {v:g}, {across} {w:g}"] for w in GRID[across]] for v in GRID[up]]
            means = np.array([[claim.ours for claim in line] for line in found])
            # where all settings are alike there is still a scale, from 0 up
            most = max(float(means.max()), 1e-3)
            picture = ax.imshow(means, cmap="cividis_r", aspect="auto", origin="lower", vmin=0.0, vmax=most)
            for (i, j), mean in np.ndenumerate(means):
                low, high = found[i][j].interval or (mean, mean)
                text, dark = f"{mean:.3g}\n{low:.2g} .. {high:.2g}", mean > 0.5 * most
                ax.text(j, i, text, ha="center", va="center", fontsize=7, color="white" if dark else "black")
            ax.set_xticks(range(len(GRID[across])), [f"{value:g}" for value in GRID[across]])
            ax.set_yticks(range(len(GRID[up])), [f"{value:g}" for value in GRID[up]])
            ax.set(xlabel=across, ylabel=up, title=f"{kind}, {how}")
            figure.colorbar(picture, ax=ax, label="mean excess, %")


def experiment(chosen: Any) -> list[Claim]:
    """Search these kinds of problems in every way."""
    claims: list[Claim] = []
    for kind in chosen.names:
        count = 2 if chosen.quick else PROBLEMS[kind]
        problems = [problem(kind, number) for number in range(count)]
        # of what a minute does not prove the best that it gives
        best = [assoc.assign(instance, "exact", time_limit=60.0) for instance in problems]
        optima = np.array([solution.cost for solution in best])
        proven = sum(solution.status == "optimal" for solution in best)
        greedy = np.array([assoc.assign(instance, "greedy").cost for instance in problems])
        claims.append(Claim(f"{kind}, problems: optima proven of {count}", "", None, proven))
        claims.append(_mean(f"{kind}, greedy: excess", 100.0 * (greedy - optima) / np.abs(optima)))
        for how in HOW:
            claims += claims_of(f"{kind}, {how}", excesses(how, problems, optima, chosen.seed))
            print(f"{kind}, {how}: done", flush=True)
    return claims


if __name__ == "__main__":
    raise SystemExit(main(NAME, experiment, __doc__, only=PROBLEMS))
