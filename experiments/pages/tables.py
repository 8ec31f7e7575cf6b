"""The tables of the pages but those of the papers: each from the published results, by the name of its file."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from experiments.common.claims import Claim
from experiments.common.results import Results, number, plain_table, table
from experiments.metaheuristics import parts
from experiments.metaheuristics.problems import PROBLEMS
from experiments.real.air_traffic import UNITS, WHAT
from experiments.real.autoferry import LEFT_OUT, SETS
from experiments.sdlib import store
from experiments.trackers.real_scenes import ADAPTING
from experiments.trackers.unseen import ABLATION, ALL, NAMES, WHOLE

SHOWN = {
    "oracle": "oracle",
    "multi-sensor": "`multi-sensor`",
    "static": "`static`",
    "mht": "`mht`",
    "mht-hypothesis": "`mht-hypothesis`",
    "nearest-neighbour": "`nearest-neighbour`",
    "GNN": "GNN",
    "joint-probabilistic": "`joint-probabilistic`",
}
"""Trackers as the results name them, and in the tables; GNN is `nearest-neighbour` with the rule `assignment`."""
FAR = 1.3
"""Of `multi-sensor` beside the oracle's GOSPA: more is explained."""
_HEADS = {
    "oracle": "oracle",
    "multi-sensor": "`multi-sensor` by what is declared",
    "multi-sensor if known": "if the truth is known",
    ADAPTING: "`multi-sensor`, adapting",
    "mht, adapting": "`mht`, adapting",
}
_ACCURACY = {
    "plots as they come: RMSE": "plots as they come",
    "plots, registered: RMSE": "registered",
    "plots, noise alone: RMSE": "noise alone",
    "reference, as they come: RMSE": "reference, not registered",
    "reference, registered: RMSE": "reference",
    "tracks as shown, registered: RMSE": "tracks as shown live",
    "reference, registered: squared error / stated": "squared error / stated",
}


def _judged(claim: Claim, digits: int = 3) -> str:
    """Our figure, bold where it misses its limit."""
    text = number(claim.ours, digits)
    return f"**{text}**" if claim.holds is False else text


def figure(value: float, digits: int = 3) -> str:
    """A number, whole ones as such."""
    return f"{value:,.0f}" if value == round(value) else number(value, digits)


def mean(claim: Claim, digits: int = 3) -> str:
    """A mean with half the width of its interval."""
    text = figure(claim.ours, digits)
    if claim.interval is None:
        return text
    low, high = claim.interval
    return f"{text} ± {figure((high - low) / 2, 2 if high - low < 20 else 3)}"


def with_size(results: Results, text: str) -> str:
    """A table, and below it how many scenes were run: the last sentence of what the file says of itself."""
    return f"{text}\n\nRun with: {results.head['about'].rstrip('.').rpartition('. ')[2]}."


def _tenths(claim: Claim) -> str:
    return f"{claim.ours:.1f}".removesuffix(".0")


def labels(results: Results, words: str) -> list[str]:
    """Kinds of scenes in the order of the file, by the claims that end so."""
    found = [c.quantity.removesuffix(words) for c in results.claims if c.quantity.endswith(words)]
    return [kind for kind in found if not kind.startswith("goal: ")]


def _plain(name: str, corner: str, what: Sequence[str], digits: int = 3) -> str:
    """Judged figures of an experiment: a row for each kind of problems of which the first was measured."""
    r = Results(name)
    rows = [[kind, *(_judged(r[q], digits) if (q := f"{kind}: {w}") in r else "" for w in what)]
            for kind in labels(r, f": {what[0]}")]  # fmt: skip
    return table([corner, *(w.removeprefix("faster of the two / assoc, ") for w in what)], rows)


def _sizes(r: Results, kind: str) -> list[str]:
    """Sizes of a row of experiments.scale that have been measured."""
    names = (claim.quantity for claim in r.starting(f"{kind}, "))
    return [name.split(": ")[0].rpartition(", ")[2] for name in names if name.endswith("peak")]


def scale_scans() -> str:
    """One scan: seconds and memory, size by size, and by what power they grow."""
    r = Results("scale")
    kinds = [c.quantity.split(": ")[0] for c in r.starting("one scan") if c.quantity.endswith("exponent of build")]
    what = ("measurements", "tuples", "build", "exact", "lagrangian", "greedy", "peak")
    rows = []
    for kind in kinds:
        for size in _sizes(r, kind):
            cells = [number(r[q].ours) if (q := f"{kind}, {size}: {part}") in r else "" for part in what]
            rows.append([f"{kind.removeprefix('one scan, ')}, {int(size):,}", *cells])
        powers = [number(r[q].ours) if (q := f"{kind}: exponent of {part}") in r else "" for part in what]
        rows.append([f"{kind.removeprefix('one scan, ')}: grows with the power", *powers])
    return table(["targets", *what[:2], *(f"`{part}`, s" for part in what[2:6]), "peak, MB"], rows)


def scale_trackers() -> str:
    """A scan of trackers in crowds: worst and median, and memory."""
    r = Results("scale")
    named = [c.quantity.rpartition(", ")[0] for c in r.claims if c.quantity.endswith(": worst scan")]
    rows = []
    for kind in dict.fromkeys(named):
        for size in _sizes(r, kind):
            what = ("worst", "worst scan", "median", "peak", "tracked")
            rows.append([f"`{kind}`, {int(size):,}", *(number(r[f"{kind}, {size}: {part}"].ours) for part in what)])
        if f"{kind}: exponent of worst" in r:
            worst, median = (number(r[f"{kind}: exponent of {part}"].ours) for part in ("worst", "median"))
            rows.append([f"`{kind}`: grows with the power", worst, "", median, "", ""])
    return table(["tracker, targets", "worst scan, s", "which", "median, s", "peak, MB", "tracked, %"], rows)


def close_targets() -> str:
    """GOSPA and identity switches of every tracker where association is hard."""
    r = Results("trackers.close_targets")
    rows = [
        [
            label,
            *(f"{mean(r[f'{label}, {name}: GOSPA'])} / {_tenths(r[f'{label}, {name}: switches'])}" for name in SHOWN),
        ]
        for label in labels(r, ", oracle: GOSPA")
    ]
    return with_size(r, table(["GOSPA, m / switches", *SHOWN.values()], rows))


def bearings() -> str:
    """Every tracker on bearings alone."""
    r = Results("trackers.bearings")
    heads = {
        "targets (of 4) without a track in ten scans": "goal: {}: targets without a track in 10 scans",
        "false tracks at a time after 20 scans": "goal: {}: false tracks at a time after 20 scans",
        "targets with a track after 20 scans, %": "{}: targets with a track after 20 scans",
        "CPU time of a scan, ms": "{}: CPU time of a scan",
    }
    names = [name for name in SHOWN if name != "oracle"]
    rows = [[SHOWN[name], *(mean(r[words.format(name)], 2) for words in heads.values())] for name in names]
    return with_size(r, table(["tracker", *heads], rows))


def benchmark() -> str:
    """Ours and those of other packages on the same detections."""
    r = Results("trackers.benchmark")
    pairs = {
        "mfa": ("mht", "MFA, `mht`"),
        "gnn": ("nearest", "GNN, GNN"),
        "jpda": ("joint", "JPDA, `joint-probabilistic`"),
        "lmb": ("joint", "LMB, `joint-probabilistic`"),
    }
    rows = []
    for label in labels(r, ", mfa: mean GOSPA"):
        for peer, (own, words) in pairs.items():
            if f"{label}, {peer}: mean GOSPA" not in r:
                continue
            done = r.starting(f"{label}, {peer}: scans done, of ")[0]
            cells = (
                number(r[f"{label}, {own}: CPU time of a scan"].ours),
                number(r[f"{label}, {peer}: CPU time / ours"].ours),
                number(r[f"{label}, {peer}: mean GOSPA"].ours),
                mean(r[f"{label}, {peer}: mean GOSPA, ours - theirs"], 2),
            )
            rows.append([label, words, f"{done.ours:.0f} of {done.quantity.rpartition(' ')[2]}", *cells])
    heads = ["scans", "ours, ms a scan", "theirs / ours", "GOSPA, theirs, m", "GOSPA, ours - theirs, m"]
    return with_size(r, table(["", "theirs, ours", *heads], rows, lambda column: column > 1))


def _count(value: float) -> str:
    return "0" if value < 0.005 else number(value, 2)


def _cell(r: Results, start: str) -> str:
    """GOSPA, false tracks, switches; nothing where it was not run."""
    if f"{start}: GOSPA" not in r:
        return ""
    counts = (_count(r[f"{start}: {what}"].ours) for what in ("false tracks", "switches"))
    return " / ".join([mean(r[f"{start}: GOSPA"]), *counts])


def as_they_are() -> str:
    """Every row with the usual trackers."""
    r = Results("trackers.as_they_are")
    shown = []
    for row in labels(r, ", oracle: GOSPA"):
        missed = (_count(r[f"{row}, {name}: missed targets"].ours) for name in ("oracle", ADAPTING))
        shown.append([row, *(_cell(r, f"{row}, {name}") for name in _HEADS), " / ".join(missed)])
    heads = ["GOSPA, m / false tracks / switches", *_HEADS.values(), "missed: oracle / `multi-sensor`, adapting"]
    return with_size(r, table(heads, shown))


def autoferry() -> str:
    """The boats of the Autoferry recordings: GOSPA of every tracker."""
    r = Results("real.autoferry")
    known = SHOWN | {ADAPTING: _HEADS[ADAPTING], LEFT_OUT: "`multi-sensor`, left out"}
    shown = []
    for which in SETS:
        names = [name for name in known if f"{which}, {name}, mean: GOSPA" in r]
        for name in names:
            start = f"{which}, {name}, "
            each = r.starting(f"{start}scenario")
            shown.append([which, known[name], *(f"{c.ours:.1f}" for c in each), f"{r[start + 'mean: GOSPA'].ours:.1f}"])
    start = next(c.quantity for c in r.claims).rpartition(", scenario")[0]
    numbers = [c.quantity.rpartition("scenario ")[2].partition(":")[0] for c in r.starting(f"{start}, scenario")]
    heads = ["GOSPA, m", "tracker", *(f"scenario {n}" for n in numbers), "mean"]
    return table(heads, shown, lambda column: column > 1)


def air_traffic() -> str:
    """How far plots and reference trajectories are from the flights."""
    r = Results("real.air_traffic")
    rows = [
        [kind, *(mean(r[f"{kind}, {part}"]) for part in _ACCURACY)] for kind in labels(r, f", {next(iter(_ACCURACY))}")
    ]
    return with_size(r, table(["RMSE, m", *_ACCURACY.values()], rows))


def air_traffic_association() -> str:
    """Wrong plots and mixed tracks."""
    r = Results("real.air_traffic")
    rows = [
        [kind, *(mean(r[f"{kind}, assoc: {what}"], 2) for what in WHAT)]
        for kind in labels(r, f", {next(iter(_ACCURACY))}")
    ]
    return table(["flights", *(f"{what}{', %' if UNITS[what] else ''}" for what in WHAT)], rows)


def _excess(claim: Claim) -> str:
    """A mean with its interval; bold where the whole interval is above 0, italic where it is below."""
    low, high = claim.interval or (claim.ours, claim.ours)
    text = f"{number(claim.ours, 2)} ({number(low, 2)} .. {number(high, 2)})"
    if low > 1e-9:
        return f"**{text}**"
    return f"*{text}*" if high < -1e-9 else text


def _parts(solver: str) -> str:
    """What each part of a metaheuristic is worth, on the problems on which variants were measured."""
    r, order = Results("metaheuristics.ablation"), list(PROBLEMS)
    found = {c.quantity.split(": ")[0] for c in r.claims if f", {parts.ALONE}, " in c.quantity}
    groups = sorted(found, key=lambda group: (order.index(group.split(", ")[0]), group))
    rows = []
    for part in (part for part in parts.PARTS if solver in part.solvers):
        whole = part.words == parts.WHOLE
        words = "all parts: above the best found" if whole else part.words
        names = [f"{g}: {solver}, {part.words}, above {'the best found' if whole else part.base}" for g in groups]
        rows.append([words, *(_excess(r[name]) if name in r else "" for name in names)])
    heads = [f"{group}, {r[f'{group}: problems'].ours:.0f} problems" for group in groups]
    return table([f"`{solver}`, excess in %", *heads], rows)


def benchmark_set() -> str:
    """Return the tables as text."""
    rows = store.table()
    families: dict[str, list[str]] = defaultdict(list)
    for name, row in rows.items():
        families[row["family"]].append(name)
    proved = {name: row["status"] == "optimal" for name, row in rows.items()}
    few = []
    for family, names in sorted(families.items()):
        counts = [rows[name]["tuples"] for name in names]
        few.append([family, str(len(names)), f"{min(counts):,} to {max(counts):,}", str(sum(map(proved.get, names)))])
    head = ["instance", "sizes", "tuples", "components", "root bound", "value", "best bound", "status", "found by"]
    return "\n\n".join((
        f"{len(rows)} instances, {sum(proved.values())} proved optimal "
        f"({100 * sum(proved.values()) / len(rows):.0f} %), each with a proof in the repository.",
        plain_table(["family", "instances", "tuples", "proved"], few),
        plain_table([*head, "seconds"], [_line(name, rows[name]) for names in families.values() for name in names]),
    ))  # fmt: skip


def _line(name: str, row: dict[str, Any]) -> list[str]:
    bound = row["value"] if row["status"] == "optimal" else f"{row['bound']:.6f}"
    return [
        name, " ".join(map(str, row["sizes"])), f"{row['tuples']:,}", f"{row['components']:,}",
        f"{row['root bound']:.6f}", row["value"], bound, row["status"], f"{row['who']}, {row['when']}",
        f"{row['seconds']:.2f}",
    ]  # fmt: skip


def _said() -> dict[str, tuple[str, str]]:
    """Kinds of unseen scenes: in words, and what is behind figures far from the oracle's."""
    lines = (Path(__file__).parent / "unseen.txt").read_text(encoding="utf-8").splitlines()
    return {kind: (words, why) for kind, words, why in (line.split(": ", 2) for line in lines)}


def unseen() -> str:
    """GOSPA on unseen scenes and recordings by kind, and what is behind each figure far from the oracle's."""
    r, said, shown, behind = Results("trackers.unseen"), _said(), [], []
    for kind in labels(r, ", oracle: GOSPA"):
        words, why = said.get(kind, (kind, "**not explained**"))
        cells = []
        for start in (f"{kind}, {name}" for name in NAMES):
            parts = [mean(r[f"{start}: GOSPA"])] if f"{start}: GOSPA" in r else []
            cells.append(" / ".join(parts + [_count(r[q].ours) for q in [f"{start}: changes"] if q in r]))
        shown.append([words, *cells])
        factor = r[f"{kind}, {WHOLE}: GOSPA"].ours / r[f"{kind}, oracle: GOSPA"].ours
        if factor > FAR:
            behind.append(f"- {words}, {number(factor, 2)} times the oracle: {why}")
    heads = ["GOSPA, m / changes of track, %", *(SHOWN.get(name, name) for name in NAMES)]
    return "\n\n".join([table(heads, shown), *(["\n".join(behind)] if behind else [])])


def ablation() -> str:
    """`multi-sensor` without each part of what adapts: GOSPA over that with all."""
    r = Results("trackers.unseen")
    rows = []
    for kind in labels(r, f", {next(iter(ABLATION))}: GOSPA"):
        whole = r[f"{kind}, {ALL}: GOSPA"].ours
        rows.append([_said().get(kind, (kind, ""))[0], mean(r[f"{kind}, {ALL}: GOSPA"]),
                     *(number(r[f"{kind}, {name}: GOSPA"].ours / whole) for name in ABLATION)])  # fmt: skip
    return table(["", "all: GOSPA, m", *(f"without {name.partition('without ')[2]}" for name in ABLATION)], rows)


TABLES: dict[str, Callable[[], str]] = {
    "benchmark-set": benchmark_set,
    "speed-ratios": partial(
        _plain, "filters.benchmark", "faster of the two / assoc",
        [f"faster of the two / assoc, {how}" for how in (
            "one track, a step in two calls", "one track, a step in one call", "one track's recording in a call",
            "in a batch",
        )],
    ),
    "large-components": partial(
        _plain, "large_components", "problems", ("tuples", "exact, s", "slowest, s", "others / exact", "least ratio")
    ),
    "anytime": partial(
        _plain, "anytime", "problem, solver", ("behind after 1 s", "behind after 5 s", "area", "gap")
    ),
    "scale-scans": scale_scans,
    "scale-trackers": scale_trackers,
    "probabilities": partial(
        _plain, "probabilities", "",
        ("mean error", "largest error", "within four errors", "seconds"),
    ),
    "linking": partial(
        _plain, "linking", "points",
        [f"{what}, {who}" for who in ("assoc", "trackpy", "laptrack") for what in ("recall", "precision", "seconds")],
    ),
    "prior": partial(
        _plain, "ambiguous_bearings", "scene, cost",
        ("targets found of each 100 there", "true tuples found", "chosen tuples that are true", "proven optima"),
    ),
    "close-targets": close_targets,
    "bearings": bearings,
    "stone-soup": benchmark,
    "as-they-are": as_they_are,
    "unseen": unseen,
    "unseen-ablation": ablation,
    "autoferry": autoferry,
    "air-traffic": air_traffic,
    "air-traffic-association": air_traffic_association,
    **{f"parts-{solver}": partial(_parts, solver) for solver in parts.SOLVERS},
}  # fmt: skip
"""Name of the file -> what makes it."""
