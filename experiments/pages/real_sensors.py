"""Tables of the page on sensors as they are, and of recordings with their truth."""

from experiments.common.results import Results, number, table
from experiments.pages.trackers import SHOWN, labels, mean, with_size
from experiments.real.air_traffic import UNITS, WAYS, WHAT
from experiments.real.autoferry import SETS
from experiments.trackers.real_scenes import ADAPTING, JOINT, ROWS, SITES

_FILE, _KNOWN = "trackers.as_they_are", "multi-sensor if known"
_HEADS = {
    "oracle": "oracle",
    "multi-sensor": "`multi-sensor` by what is declared",
    _KNOWN: "if the truth is known",
    ADAPTING: "`multi-sensor`, adapting",
    "mht, adapting": "`mht`, adapting",
}
_PARTS = {
    "views": "fields of view, and who looked",
    "heights": "states with heights",
    "estimates": "estimates of noise, P_d, false alarms, manoeuvres",
    "map": "a map of clutter",
    "life": "lost tracks taken up, tracks shown while they coast",
}


def _count(value: float) -> str:
    return "0" if value < 0.005 else number(value, 2)


def _cell(r: Results, start: str) -> str:
    """GOSPA, false tracks, switches; nothing where it was not run."""
    if f"{start}: GOSPA" not in r:
        return ""
    counts = (_count(r[f"{start}: {what}"].ours) for what in ("false tracks", "switches"))
    return " / ".join([mean(r[f"{start}: GOSPA"]), *counts])


def rows() -> str:
    """Every row with the usual trackers."""
    r = Results(_FILE)
    shown = []
    for row in labels(r, ", oracle: GOSPA"):
        missed = (_count(r[f"{row}, {name}: missed targets"].ours) for name in ("oracle", ADAPTING))
        shown.append([row, *(_cell(r, f"{row}, {name}") for name in _HEADS), " / ".join(missed)])
    heads = ["GOSPA, m / false tracks / switches", *_HEADS.values(), "missed: oracle / `multi-sensor`, adapting"]
    return with_size(r, table(heads, shown))


def without() -> str:
    """Each part left out, alone."""
    r, shown = Results(_FILE), []
    for part, words in _PARTS.items():
        for row in (label for label, case in ROWS.items() if part in case.without):
            cells = [_cell(r, f"{row}, {name}") for name in ("oracle", ADAPTING, f"multi-sensor, without {part}")]
            ids = (f"{row}, {name}: ids" for name in (ADAPTING, f"multi-sensor, without {part}"))
            shown.append([words, row, *cells, " / ".join(_count(r[kind].ours) for kind in ids if kind in r)])
    heads = ["scenes", "oracle", "with it", "without", "ids with / without"]
    return table(["left out", *heads], shown, lambda column: column > 1)


def joint() -> str:
    """Targets side by side, and sites that send tracks."""
    r, shown = Results(_FILE), []
    names = (ADAPTING, "GNN", JOINT, f"{JOINT}, all permutations", SITES)
    for row in (label for label, case in ROWS.items() if case.also):
        cells = []
        for name in names:
            gap = f"{row}, {name}: gap of the tracks / true gap"
            cells.append(_cell(r, f"{row}, {name}") + (f" / {r[gap].ours:.2f}" if gap in r else ""))
        shown.append([row, *cells])
    heads = ["`multi-sensor`, adapting", "GNN", "`joint-probabilistic`", "the same, all permutations", "three sites"]
    return table(["GOSPA, m / false tracks / switches (/ gap)", *heads], shown)


def autoferry() -> str:
    """The boats of the Autoferry recordings: GOSPA of every tracker."""
    r, known = Results("real.autoferry"), SHOWN | {ADAPTING: _HEADS[ADAPTING]}
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


_ACCURACY = {
    "plots as they come: RMSE": "plots as they come",
    "plots, registered: RMSE": "registered",
    "plots, noise alone: RMSE": "noise alone",
    "reference, as they come: RMSE": "reference, not registered",
    "reference, registered: RMSE": "reference",
    "tracks as shown, registered: RMSE": "tracks as shown live",
    "reference, registered: squared error / stated": "squared error / stated",
}
_TRAFFIC = "real.air_traffic"


def air_traffic() -> str:
    """How far plots and reference trajectories are from the flights."""
    r = Results(_TRAFFIC)
    rows = [
        [kind, *(mean(r[f"{kind}, {part}"]) for part in _ACCURACY)] for kind in labels(r, f", {next(iter(_ACCURACY))}")
    ]
    return with_size(r, table(["RMSE, m", *_ACCURACY.values()], rows))


def air_traffic_association() -> str:
    """Wrong plots and mixed tracks, by way to associate."""
    r = Results(_TRAFFIC)
    rows = [
        [kind, way, *(mean(r[f"{kind}, {way}: {what}"], 2) for what in WHAT)]
        for kind in labels(r, f", {next(iter(_ACCURACY))}")
        for way in WAYS
    ]
    return table(["flights", "by", *(f"{what}{', %' if UNITS[what] else ''}" for what in WHAT)], rows,
                 lambda column: column > 1)  # fmt: skip


TABLES = {
    "air-traffic": air_traffic,
    "air-traffic-association": air_traffic_association,
    "as-they-are": rows,
    "as-they-are-without": without,
    "as-they-are-joint": joint,
    "autoferry": autoferry,
}
