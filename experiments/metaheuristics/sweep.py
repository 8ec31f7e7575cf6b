"""What alpha, beta, rho, the number of ants and the refinement do where problems are not easy.

On the ant colony paper's own scene every setting finds every optimum, so that its table 1 says nothing of solutions.
Here are the same scene with noise of 200 m and ten times the false alarms ("noisy radars"; still easy: greedy finds
every optimum), with noise of 4 km and thirty times the false alarms ("poor radars"), and scenes of three bearing-only
sensors full of ghosts. All 54 settings of alpha 0, 1, 2, beta 1, 2, 4, rho 0.3, 0.9 and 5, 15, 45 ants run
on the same problems: mode "paper" until all ants walk the same tour (150 cycles at the most), mode "mmas" with
refinement="none" until 900 ants have walked, with refinement="full" for three cycles. So all have an effort that
does not depend on the machine. A figure is the mean excess over the optimum in percent; intervals are 95 %, from
resampling problems. The best setting is chosen on every second problem, and judged on the others.

The gallery draws the published figures: mean excess over alpha and beta, and over rho and ants, the other two averaged.
"""

import itertools
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple
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
from experiments.common.command import make_parser, report, without_subjects
from experiments.metaheuristics.problems import problem
from experiments.metaheuristics.running import UNLIMITED, log

NAME = "metaheuristics.sweep"
Grid = Mapping[str, tuple[float, ...]]
GRID: Grid = {"alpha": (0.0, 1.0, 2.0), "beta": (1.0, 2.0, 4.0), "rho": (0.3, 0.9), "ants": (5, 15, 45)}
ADVICE = {"alpha": 2.0, "beta": 1.0, "rho": 0.3, "ants": 15}
"""What table 1 of the paper ends with, and the defaults of `AcoParameters`."""
SURFACES = (("alpha", "beta"), ("rho", "ants"))
_WALKS = 900


class Case(NamedTuple):
    """Problems, and how the ants search them.

    problems: Name in problems.py.
    count: Number of problems.
    how: "paper", "mmas, none" or "mmas, full".
    """

    problems: str
    count: int
    how: str

    @property
    def name(self) -> str:
        """How it is reported."""
        return f"{self.problems}, {self.how}"


HOW = ("paper", "mmas, none", "mmas, full")
CASES = (
    *(Case(name, 20, how) for name in ("noisy radars", "poor radars") for how in HOW),
    *(Case(name, 12, how) for name in ("ghosts 20", "ghosts 40") for how in HOW),
)


def settings(grid: Grid = GRID) -> list[dict[str, Any]]:
    """All settings, in the order of the arrays."""
    made = [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]
    return [setting | {"ants": int(setting["ants"])} for setting in made]


def _setting(how: str, values: dict[str, Any]) -> Setting:
    if how == "paper":
        return Setting("aco", {"mode": "paper", "iterations": 150, **values})
    refinement = how.removeprefix("mmas, ")
    cycles = 3 if refinement == "full" else _WALKS // values["ants"]
    more = {"refinement": refinement, "iterations": cycles, "patience": UNLIMITED}
    return Setting("aco", {**values, **more})


def excesses(case: Case, problems: Sequence[AssignmentProblem], optima: Floats, seed: int, grid: Grid = GRID) -> Floats:
    """Excess of every setting on every problem, percent."""
    made = [_setting(case.how, values) for values in settings(grid)]
    sources = [StudySource(instance, f"{number:03d}") for number, instance in enumerate(problems)]
    # what an answer proves is not asked for: it would take longer than the ants
    without = mock.patch.object(improve, "close", lambda component, run: None)
    with tempfile.TemporaryDirectory(prefix="assoc-") as folder, without:
        Study(sources, made, 1, seed).run(folder)
        frame = load(folder)
    costs = frame.pivot(index="setting", columns="scene", values="cost").loc[[setting.key for setting in made]]
    return 100.0 * (costs.to_numpy(dtype=float) - optima) / np.abs(optima)


def optima_of(problems: Sequence[AssignmentProblem]) -> tuple[Floats, int]:
    """Optimal costs, and how many of them are proven (else the best that a minute gives)."""
    found = [assoc.assign(instance, "exact", time_limit=60.0) for instance in problems]
    return np.array([solution.cost for solution in found]), sum(solution.status == "optimal" for solution in found)


def claims_of(case: Case, excess: Floats, grid: Grid = GRID) -> list[Claim]:
    """The claims of one case; excess (settings, problems)."""
    every = settings(grid)

    def claim(words: str, values: Floats) -> Claim:
        interval = mean_interval(values[:, None])
        return Claim(f"{case.name}: {words}", "%", None, float(values.mean()), interval)

    found = []
    for names in SURFACES:
        for values in itertools.product(*(grid[name] for name in names)):
            chosen = [all(setting[n] == v for n, v in zip(names, values, strict=True)) for setting in every]
            words = ", ".join(f"{name} {value:g}" for name, value in zip(names, values, strict=True))
            found.append(claim(words, excess[chosen].mean(axis=0)))
    train, test = excess[:, ::2], excess[:, 1::2]
    best = int(train.mean(axis=1).argmin())
    words = " ".join(f"{name} {value:g}" for name, value in every[best].items())
    found.append(claim(f"best setting, {words}", test[best]))
    place = every.index(ADVICE)
    found.append(claim("table 1's advice", test[place]))
    found.append(claim("table 1's advice less the best setting", test[place] - test[best]))
    means = excess.mean(axis=1)
    found.append(claim("worst setting", excess[int(means.argmax())]))
    # settings that tie share the places between them
    rank = 1 + (means < means[place] - 1e-9).sum() + (np.abs(means - means[place]) <= 1e-9).sum() / 2 - 0.5
    found.append(Claim(f"{case.name}: rank of table 1's advice of {len(every)}", "", None, float(rank)))
    return found


def draw(figure: Any, shown: tuple[list[Case], dict[str, Claim]]) -> None:
    """Draw the surfaces of all cases of one kind of problem."""
    cases, claims = shown
    axes = figure.subplots(len(cases), 2, squeeze=False)
    for row, case in zip(axes, cases, strict=True):
        for ax, (up, across) in zip(row, SURFACES, strict=True):
            found = [
                [claims[f"{case.name}: {up} {v:g}, {across} {other:g}"] for other in GRID[across]] for v in GRID[up]
            ]
            means = np.array([[claim.ours for claim in line] for line in found])
            # where all settings are alike there is still a scale, from 0 up
            most = max(float(means.max()), 1e-3)
            picture = ax.imshow(means, cmap="cividis_r", aspect="auto", origin="lower", vmin=0.0, vmax=most)
            dark = 0.5 * most
            for (i, j), mean in np.ndenumerate(means):
                low, high = found[i][j].interval or (mean, mean)
                text = f"{mean:.3g}\n{low:.2g} .. {high:.2g}"
                ax.text(j, i, text, ha="center", va="center", fontsize=7, color="white" if mean > dark else "black")
            ax.set_xticks(range(len(GRID[across])), [f"{value:g}" for value in GRID[across]])
            ax.set_yticks(range(len(GRID[up])), [f"{value:g}" for value in GRID[up]])
            ax.set(xlabel=across, ylabel=up, title=case.name)
            figure.colorbar(picture, ax=ax, label="mean excess, %")


def pictures(claims: list[Claim], every: Sequence[Case] = CASES) -> dict[str, tuple[Any, tuple[float, float]]]:
    """Return what `draw` shows of each kind of problem in the claims, and its size in inches, by the picture's name."""
    by_name = {claim.quantity: claim for claim in claims}
    found = {}
    for kind in dict.fromkeys(case.problems for case in every):
        cases = [case for case in every if case.problems == kind and f"{case.name}: worst setting" in by_name]
        if cases:
            found[f"surfaces-{kind.replace(' ', '-')}"] = ((cases, by_name), (9.0, 3.2 * len(cases)))
    return found


def program(arguments: Sequence[str] | None = None, *, cases: Sequence[Case] = CASES, grid: Grid = GRID) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, __doc__)
    names = [case.name for case in cases]
    parser.add_argument(
        "--cases", nargs="+", choices=names, default=names, metavar="NAME", help=f"only these: {'; '.join(names)}"
    )
    chosen = parser.parse_args(arguments)
    if chosen.publish and chosen.quick:
        parser.error("--publish needs the full run, got --quick")
    claims: list[Claim] = []
    known: dict[str, tuple[list[AssignmentProblem], Floats]] = {}
    for case in cases:
        if case.name not in chosen.cases:
            continue
        if case.problems not in known:
            problems = [problem(case.problems, number) for number in range(2 if chosen.quick else case.count)]
            optima, proven = optima_of(problems)
            known[case.problems] = problems, optima
            log(f"{case.problems}: {proven} of {len(problems)} optima proven")
            claims.append(Claim(f"{case.problems}, problems: optima proven of {len(problems)}", "", None, proven))
            greedy = [assoc.assign(instance, "greedy").cost for instance in problems]
            excess = 100.0 * (np.array(greedy) - optima) / np.abs(optima)
            interval = mean_interval(excess[:, None])
            claims.append(Claim(f"{case.problems}, greedy: excess", "%", None, float(excess.mean()), interval))
        problems, optima = known[case.problems]
        claims += claims_of(case, excesses(case, problems[: case.count], optima[: case.count], chosen.seed, grid), grid)
        log(f"{case.name}: done")
    of = partial(without_subjects, lambda claim: claim.quantity.split(": ")[0])
    report(chosen, claims, NAME, __doc__, seed=chosen.seed, is_row=_is_cell, kept=of)
    return 0


def _is_cell(claim: Claim) -> bool:
    """Whether a claim is one cell of a surface."""
    return claim.quantity.split(": ")[-1].startswith(tuple(f"{names[0]} " for names in SURFACES))


if __name__ == "__main__":
    raise SystemExit(program())
