"""Tables of measured trackers: docs/tracking_measured.md, and biased radars for docs/registration.md."""

from collections.abc import Sequence
from pathlib import Path

from experiments.common.claims import Claim
from experiments.common.results import RESULTS, Results, number, table

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
GOALS = (
    "close_targets", "as_they_are", "bearings", "asynchronous", "comparison", "biases", "benchmark", "capacity", "live",
)  # fmt: skip
"""Experiments whose goals are listed, in this order."""

_PARTS = ("localisation", "missed", "false")


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


def fusion_in_stone_soup() -> str:
    """Three ways to track three radars in Stone Soup."""
    r = Results("trackers.fusion_in_stone_soup")
    ways = [c.quantity.removesuffix(": GOSPA, missed") for c in r.claims if c.quantity.endswith(": GOSPA, missed")]
    rows = []
    for way in ways:
        less, ratio = f"{way} less {ways[0]}: GOSPA", f"{ways[0]} / {way}: time"
        cells = [mean(r[f"{way}: {part}"]) for part in ("GOSPA", *(f"GOSPA, {loss}" for loss in _PARTS))]
        cells += ["" if words not in r else mean(r[words]) for words in (less, less + " from 18 s on")]
        rows.append([way, *cells, "1" if ratio not in r else number(1.0 / r[ratio].ours, 2)])
    head = ["GOSPA, m", "mean", *_PARTS, "less the first row's", "that from 18 s on", "time / first row's"]
    return table(head, rows)


def in_stone_soup() -> str:
    """Every way to track of the examples of docs/stonesoup."""
    r = Results("trackers.in_stone_soup")
    rows, before = [], ""
    for start in labels(r, ": GOSPA"):
        name, _, way = start.partition(", ")
        less, time = f"{start}: GOSPA less the first's", r[f"{start}: CPU time of a scan"]
        shown = "" if name == before else f"`{name}.py`"
        rows.append([shown, way, mean(r[f"{start}: GOSPA"]), mean(r[less]) if less in r else "", number(time.ours, 2)])
        before = name
    head = ["example", "way to track", "GOSPA, m", "less the first's, m", "CPU time of a scan, ms"]
    return table(head, rows, lambda column: column > 1)


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


def close_times() -> str:
    """OSPA(2), HOTA and CPU time of a scan of every tracker where association is hard."""
    r = Results("trackers.close_targets")

    def cell(start: str) -> str:
        time = number(r[f"{start}: CPU time of a scan"].ours, 2)
        return f"{number(r[f'{start}: OSPA(2)'].ours)} / {r[f'{start}: HOTA'].ours:.3f} / {time}"

    rows = [[label, *(cell(f"{label}, {name}") for name in SHOWN)] for label in labels(r, ", oracle: GOSPA")]
    return table(["OSPA(2), m / HOTA / time of a scan, ms", *SHOWN.values()], rows)


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


def asynchronous() -> str:
    """Trackers of turning radars."""
    r = Results("trackers.asynchronous")
    kinds = labels(r, ", oracle: GOSPA")
    rows = []
    own = [name.removeprefix(f"{kinds[0]}, ") for name in labels(r, ": GOSPA") if name.startswith(f"{kinds[0]}, ")]
    for plain in sorted(own, key=lambda name: [*SHOWN, name].index(name)):
        cells = []
        for kind in kinds:
            gospa, switches = r[f"{kind}, {plain}: GOSPA"], r[f"{kind}, {plain}: switches"]
            cells += [f"{mean(gospa)} / {_tenths(switches)}", number(r[f"{kind}, {plain}: OSPA(2)"].ours),
                      number(r[f"{kind}, {plain}: CPU time of a scan"].ours, 2)]  # fmt: skip
        rows.append([SHOWN.get(plain, plain.replace("as one", "as if of one")), *cells])
    heads = [words for kind in kinds for words in (f"{kind}: GOSPA, m / switches", "OSPA(2), m", "time, ms")]
    return with_size(r, table(["tracker", *heads], rows))


def late() -> str:
    """What comes of late plots."""
    r = Results("trackers.asynchronous")
    rows = [
        [claim.quantity.removeprefix("late plots, ").removesuffix(": GOSPA"), mean(claim)]
        for claim in r.starting("late plots, ")
    ]
    rows.append(["CPU time of a scan with late plots, ms", number(r["late plots: CPU time of a scan"].ours)])
    return table(["plots", "GOSPA, m"], rows)


def comparison() -> str:
    """All trackers on three radars and on recorded traffic."""
    r = Results("trackers.comparison")
    rows = []
    for label in labels(r, ", oracle: GOSPA"):
        for name, shown in SHOWN.items():
            start = f"{label}, {name}: "
            parts = " / ".join(number(r[start + part].ours) for part in ("localisation", "missed", "false"))
            rows.append(
                [label, shown, mean(r[start + "GOSPA"]), parts, _tenths(r[start + "switches"]),
                 number(r[start + "OSPA(2)"].ours), f"{r[start + 'HOTA'].ours:.3f}",
                 number(r[start + "CPU time of a scan"].ours, 2)]
            )  # fmt: skip
    heads = ["GOSPA, m", "localisation / missed / false, m", "switches", "OSPA(2), m", "HOTA", "time, ms"]
    return with_size(r, table(["scenes", "tracker", *heads], rows, lambda column: column > 1))


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


def plain(name: str) -> str:
    """Every claim of an experiment, a row each."""
    rows = [[c.quantity.removeprefix("goal: "), f"{figure(c.ours)} {c.unit}".strip()] for c in Results(name).claims]
    return table(["", ""], rows)


def registration() -> str:
    """Errors of the biases found, and GOSPA with them."""
    r = Results("trackers.biases")
    rows = []
    for kind in labels(r, ", no biases: GOSPA"):
        for size in ("0 m, 0 deg", "100 m, 0.1 deg", "200 m, 0.2 deg", "300 m, 0.3 deg"):
            start = f"{kind}, {size}"
            errors = [mean(r[f"{start}: RMS error of {what}"], 2) for what in ("range", "azimuth")]
            ways = [r[f"{start}, {way}: GOSPA / without biases"] for way in ("with biases", "registered", "online")]
            rows.append([kind, size, *errors, number(ways[0].ours, 2), *(mean(claim, 4) for claim in ways[1:])])
    heads = ["error of range, m", "of azimuth, deg", "with biases", "registered", "online"]
    return with_size(r, table(["traffic", "biases", *heads], rows, lambda column: column > 1))


def goals(names: Sequence[str] = GOALS, folder: Path = RESULTS) -> str:
    """Every goal: measured, goal, met or not."""
    rows = []
    for name in names:
        for claim in Results(f"trackers.{name}", folder).starting("goal: "):
            low, high = claim.band
            words = f"at least {low:.4g}" if low is not None else f"at most {high:.4g}"
            unit = f" {claim.unit}" if claim.unit else ""
            # of a ratio what it is above or below 1 matters
            digits = 4 if not unit and 0.5 < claim.ours < 2 else 3
            rows.append(
                [f"`{name}`", claim.quantity.removeprefix("goal: "), mean(claim, digits) + unit, words + unit,
                 "yes" if claim.holds else "**no**"]
            )  # fmt: skip
    met = sum(row[-1] == "yes" for row in rows)
    head = f"{met} of {len(rows)} goals are met.\n\n"
    return head + table(["experiment", "what", "measured", "goal", "met"], rows, lambda column: column in (2, 3))


TABLES = {
    "close-targets": close_targets,
    "close-targets-times": close_times,
    "bearings": bearings,
    "turning-radars": asynchronous,
    "late-plots": late,
    "trackers": comparison,
    "stone-soup": benchmark,
    "capacity": lambda: plain("trackers.capacity"),
    "live": lambda: plain("trackers.live"),
    "goals": goals,
    "biases": registration,
    "fusion": fusion_in_stone_soup,
    "in-stone-soup": in_stone_soup,
}
