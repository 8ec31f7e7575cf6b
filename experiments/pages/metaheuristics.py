"""What the parts and the settings of the metaheuristics do, made from the published results."""

from collections.abc import Callable

from experiments.common.claims import Claim
from experiments.common.results import Results, number, table
from experiments.metaheuristics import parts, sweep
from experiments.metaheuristics.ablation import WORKERS
from experiments.metaheuristics.problems import PROBLEMS


def _cell(claim: Claim) -> str:
    """A mean with its interval; bold where the whole interval is above 0, italic where it is below."""
    low, high = claim.interval or (claim.ours, claim.ours)
    text = f"{number(claim.ours, 2)} ({number(low, 2)} .. {number(high, 2)})"
    if low > 1e-9:
        return f"**{text}**"
    return f"*{text}*" if high < -1e-9 else text


def _groups(results: Results, words: str) -> list[str]:
    """Problems with their budgets for which a variant was measured, in the order in which they are defined."""
    found = {claim.quantity.split(": ")[0] for claim in results.claims if f", {words}, " in claim.quantity}
    names = list(PROBLEMS)
    return sorted(found, key=lambda group: (names.index(group.split(", ")[0]), group))


def _of_solver(solver: str) -> Callable[[], str]:
    def make() -> str:
        r = Results("metaheuristics.ablation")
        groups = _groups(r, parts.ALONE)
        rows = []
        for part in parts.PARTS:
            if solver in part.solvers:
                above = "the best found" if part.words == parts.WHOLE else part.base
                words = "all parts: above the best found" if part.words == parts.WHOLE else part.words
                names = [f"{group}: {solver}, {part.words}, above {above}" for group in groups]
                rows.append([words, *(_cell(r[name]) if name in r else "" for name in names)])
        heads = [f"{group}, {r[f'{group}: problems'].ours:.0f} problems" for group in groups]
        return table([f"`{solver}`, excess in %", *heads], rows)

    return make


def workers() -> str:
    """Two workers on two cores against one."""
    r = Results("metaheuristics.ablation")
    words = parts.TWO_WORKERS.words
    groups = _groups(r, words)
    rows = []
    for solver in parts.SOLVERS:
        whole = [r[f"{group}: {solver}, {parts.WHOLE}, above the best found"] for group in groups]
        two = [r[f"{group}: {solver}, {words}, above {parts.WHOLE}"] for group in groups]
        rows.append([f"`{solver}`, one worker: above the best found", *map(_cell, whole)])
        rows.append([f"`{solver}`, two workers less one", *map(_cell, two)])
    heads = [f"{group.removesuffix(WORKERS)}, {r[f'{group}: problems'].ours:.0f} problems" for group in groups]
    return table(["excess in %", *heads], rows)


def settings() -> str:
    """Best setting and advice of every case."""
    r = Results("metaheuristics.sweep")
    rows = []
    for case in sweep.CASES:
        if f"{case.name}: worst setting" not in r:
            continue
        best = r.starting(f"{case.name}: best setting")[0]
        alike = r[f"{case.name}: worst setting"].ours < 1e-9
        words = "all are alike" if alike else best.quantity.split("best setting, ")[1]
        rank = r.starting(f"{case.name}: rank of table 1's advice")[0]
        of = rank.quantity.rsplit(" ", 1)[1]
        rows.append([
            f"{case.problems}, mode {case.how}", words, _plain(best),
            _plain(r[f"{case.name}: table 1's advice"]),
            # a setting less itself says nothing
            "it is the best" if rank.ours == 1.0 else _cell(r[f"{case.name}: table 1's advice less the best setting"]),
            f"{number(rank.ours, 2)} of {of}", _plain(r[f"{case.name}: worst setting"]),
            _plain(r[f"{case.problems}, greedy: excess"]),
        ])  # fmt: skip
    heads = ["excess in %", "best setting", "it", "table 1's advice", "less the best", "its rank", "worst", "greedy"]
    return table(heads, rows, lambda column: column > 1)


def _plain(claim: Claim) -> str:
    return number(claim.ours, 2)


TABLES = {
    **{f"parts-{solver}": _of_solver(solver) for solver in parts.SOLVERS},
    "workers": workers,
    "settings": settings,
}
