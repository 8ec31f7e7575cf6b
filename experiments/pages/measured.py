"""Tables of measured figures for the pages of filters, recordings, sweeps, trackers and concepts."""

from collections.abc import Iterable, Sequence
from functools import partial

from experiments.common.claims import Claim
from experiments.common.results import Results, number, table
from experiments.pages.trackers import labels

SCENARIOS = tuple("CDEFGH")


def _judged(claim: Claim, digits: int = 3) -> str:
    """Our figure, bold where it misses its limit."""
    text = number(claim.ours, digits)
    return f"**{text}**" if claim.holds is False else text


def _grid(r: Results, kinds: Iterable[str], what: Sequence[str], digits: int = 3) -> list[list[str]]:
    """A row of judged figures for each kind; a cell is empty where nothing was measured."""
    return [[kind, *(_judged(r[q], digits) if (q := f"{kind}: {w}") in r else "" for w in what)] for kind in kinds]


def fuzzy() -> str:
    """RMSE and ratios of the fuzzy filters on scenarios C to H."""
    r = Results("papers.fuzzy_ekf")

    def find(scenario: str, words: str) -> Claim:
        # names of the best fixed filters follow in brackets
        found = r.starting(f"{scenario}: {words}")
        return min(found, key=lambda claim: len(claim.quantity.split(" (")[0]))

    lines = (
        ("raw measurements", "RMSE, raw measurements"),
        ("best fixed EKF, constant velocity or acceleration", "RMSE, best fixed EKF ("),
        ("best fixed EKF, constant acceleration (the paper's model)", "RMSE, best fixed EKF of constant acceleration"),
        ("best fixed EKF with the turn rate in its state", "RMSE, best fixed EKF with turn rate"),
        ("the paper's rules, sets and base noise tuned by us", "RMSE, the paper's rules, tuned sets"),
        ("the paper's rules, sets chosen by eye", "RMSE, the paper's rules, sets chosen by eye"),
        ("Q_0, R_0, P_0 of equations 38 to 40 taken literally, EKF", "RMSE, Q_0, R_0 and P_0 taken literally, EKF"),
        ("the same with the rules", "RMSE, Q_0, R_0 and P_0 taken literally, with rules"),
        ("tuned rules", "RMSE, tuned rules"),
        ("IMM, tuned with the same care", "RMSE, IMM"),
    )
    ratios = (
        ("the paper's rules, tuned sets / best fixed EKF of constant acceleration (at most 1)", None),
        ("the paper's rules, tuned sets / best fixed EKF (at most 1)", None),
        ("tuned rules / best fixed EKF (at most 0.97)", None),
        ("tuned rules / best fixed EKF with turn rate (at most 0.97)", None),
        ("tuned rules / IMM (at most 1.08)", None),
        ("tuned rules / IMM, both smoothed over 2 steps (at most 1.08)", None),
    )
    rows = [[name, *(number(find(s, words).ours) for s in SCENARIOS)] for name, words in lines]
    rows += [[name, *(_judged(r[f"{s}: {name.split(' (at')[0]}"]) for s in SCENARIOS)] for name, _ in ratios]
    return table(["", *SCENARIOS], rows)


def phases() -> str:
    """Tuned rules and IMM in straight flight and in turns."""
    r = Results("papers.fuzzy_ekf")
    rows = [
        [phase, *(" / ".join(number(r[f"{s}: RMSE in {phase}, {way}"].ours) for way in ("tuned rules", "IMM"))
                  for s in SCENARIOS)]
        for phase in ("straight flight", "turns and 5 s after")
    ]  # fmt: skip
    return table(["", *SCENARIOS], rows)


def paper_setting() -> str:
    """Table 4.3 of the modified EKF's paper in each reading."""
    r = Results("papers.modified_ekf")
    readings = ("sigmas", "R_k", "mixed", "moving")
    rows = []
    for variable in ("x", "y", "z", "Vx", "Vy", "Vz"):
        for name in ("EKF", "modified"):
            claims = [r[f"simulation 1, reading {reading}: RMSE of {variable}, {name}"] for reading in readings]
            rows.append([f"{variable}, {name}", number(claims[0].paper), *(_judged(claim) for claim in claims)])
    claims = [r[f"simulation 1, reading {reading}: modified / EKF, RMSE of the position"] for reading in readings]
    ratio = number(claims[0].paper, 2)
    rows.append(["position, modified / EKF (below 0.99)", ratio, *(_judged(claim) for claim in claims)])
    more = (
        ("beta", "beta"),
        ("r x prior variance of azimuth / sigma_range", "r * prior variance of azimuth / sigma_range, mean"),
    )
    for words, quantity in more:
        rows.append([words, "", *(number(r[f"simulation 1, reading {x}: {quantity}"].ours, 2) for x in readings)])
    return table(["", "paper", *(f'"{name}"' for name in readings)], rows)


KINDS = ("Kalman", "EKF", "UKF", "EnKF")
COLUMNS = {
    "filterpy": "filterpy",
    "Stone Soup": "Stone Soup",
    "one track, `predict` and `update`": "assoc, two calls",
    "one track, `step`": "assoc, one call",
    "one track's recording, `run`": "assoc, a recording",
    "batch, a track": "assoc, batch",
}


def speed() -> str:
    """Microseconds of every filter and package."""
    r = Results("filters.benchmark")
    rows = [[kind, *(number(r[f"{kind}: {name}"].ours, 2) for name in COLUMNS.values())] for kind in KINDS]
    return table(["", *COLUMNS], rows)


def speed_ratios() -> str:
    """The faster of the two other packages divided by ours."""
    r = Results("filters.benchmark")
    names = {
        "`predict` and `update`": "one track, a step in two calls",
        "`step`": "one track, a step in one call",
        "`run`": "one track's recording in a call",
        "batch": "in a batch",
    }
    rows = [
        [kind, *(_judged(r[f"{kind}: faster of the two / assoc, {words}"]) for words in names.values())]
        for kind in KINDS
    ]
    return table(["", *names], rows)


def batch() -> str:
    """Updates in a batch."""
    r = Results("filters.benchmark")
    rows = [[c.quantity.split(": ")[1], _judged(c)] for c in r.starting("EKF, batch of")]
    return table(["EKF, batch of 10,000, microseconds a track (goal: 2)", ""], rows)


def _plain(name: str, corner: str, parts: Sequence[str], digits: int = 3) -> str:
    """Judged figures of an experiment: a row for each kind of problems of which the first part was measured."""
    r = Results(name)
    return table([corner, *parts], _grid(r, labels(r, f": {parts[0]}"), parts, digits))


def ghost_rankings() -> str:
    """The ten best of ghost scenes: seconds, and what is proved."""
    r = Results("ghost_rankings")
    times = ("kbest, median", "kbest, longest", "marginals, median", "marginals, longest")
    rows = []
    for kind in labels(r, ": scenes"):
        claim = r[f"{kind}: proved"]
        proved = f"{claim.ours:.0f} of {r[f'{kind}: scenes'].ours:.0f}"
        proved = proved if claim.holds else f"**{proved}**"
        rows.append([
            kind, proved, *(_judged(r[f"{kind}: {time}"]) for time in times),
            number(r[f"{kind}: widest interval, median"].ours, 2),
        ])  # fmt: skip
    return table(["", "proved", *(f"{time}, s" for time in times), "widest interval, median"], rows)


def probabilities_beside() -> str:
    """Errors and times of ways to probabilities, beside exact sums."""
    r = Results("probabilities_beside")
    kinds, ways = labels(r, ": problems summed exactly"), [text.split(", ", 1) for text in labels(r, ": mean error")]
    what = ("mean error", "largest error", "seconds")
    rows = [[kind, way, *(number(r[f"{kind}, {way}: {part}"].ours, 2) for part in what)]
            for kind in kinds for of, way in ways if of == kind]  # fmt: skip
    return table(["", "", *what], rows)


def _sizes(r: Results, kind: str) -> list[str]:
    """Sizes of a row of experiments.scale that have been measured."""
    return [
        c.quantity.split(": ")[0].rpartition(", ")[2] for c in r.starting(f"{kind}, ") if c.quantity.endswith("peak")
    ]


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


def traffic() -> str:
    """CT, MT and IT by grouping, clock and tracker."""
    r = Results("papers.clustering_time_window")
    names = {
        "nearest neighbour": "nearest neighbour",
        "MHT": "MHT, track-oriented",
        "Reid's MHT": "MHT, Reid and Murty (the thesis's)",
    }
    rows = [
        [f"thesis: {words}", "constant step", "MHT, Reid and Murty",
         *(number(r[f"{rate}, Reid's MHT, {key}"].paper or 0.0) for rate in ("CT", "MT", "IT"))]
        for words, key in (("irregular", "irregular groups"), ("window", "CTW"))
    ]  # fmt: skip
    for clock, suffix in (("constant step", ""), ("time stamps", ", time stamps")):
        for words, key in (("irregular", "irregular groups"), ("window", "CTW")):
            for name, shown in names.items():
                claims = [r[f"{rate}, {name}, {key}{suffix}"] for rate in ("CT", "MT", "IT")]
                low, high = claims[0].interval or (claims[0].ours, claims[0].ours)
                ct = f"{number(claims[0].ours)} ± {(high - low) / 2:.1f}"
                rows.append([words, clock, shown, ct, *(number(claim.ours) for claim in claims[1:])])
    return table(["grouping", "clock", "tracker", "CT", "MT", "IT"], rows, lambda column: column > 2)


def ant_colony() -> str:
    """Table 1 and its conclusions in both modes."""
    r = Results("papers.ant_colony")

    def cell(mode: str, words: str, digits: int = 3) -> str:
        claim = r[f"mode {mode}: {words}"]
        ends = "" if claim.interval is None else f" ({number(claim.interval[0], 3)} .. {number(claim.interval[1], 3)})"
        return f"{number(claim.ours, digits)}{ends}"

    means = {
        mode: [c.ours for c in r.starting("setting") if c.quantity.endswith(words)]
        for mode, words in (("paper", "mode paper: mean cycles to convergence"), ("mmas", "mode mmas: mean cycles"))
    }
    paper = [c.paper for c in r.starting("setting") if c.paper is not None]
    below = "cycles, alpha > beta less the others, whole interval below 0"
    above = "certified optimal, alpha > beta less the others, whole interval above 0"
    overall = r["mode paper: mean cycles over all settings"]
    rows = [
        ["mean cycles over the 24 settings", number(overall.paper or 0.0),
         cell("paper", "mean cycles over all settings"), number(sum(means["mmas"]) / len(means["mmas"]))],
        ["smallest and largest mean of a setting", f"{min(paper):.2f}, {max(paper):.2f}",
         *(f"{number(min(means[mode]))}, {number(max(means[mode]))}" for mode in ("paper", "mmas"))],
        ["scans certified optimal, worst setting, %", "not given",
         *(cell(mode, "least certified optimal of a setting") for mode in ("paper", "mmas"))],
        ["cycles, alpha > beta less the others", number(r[f"mode paper: {below}"].paper or 0.0, 2),
         *(cell(mode, below, 2) for mode in ("paper", "mmas"))],
        ["certified optimal, alpha > beta less the others, %", "claimed, no figure",
         *(cell(mode, above, 2) for mode in ("paper", "mmas"))],
        ["rank in cycles of rho 0.3, alpha 2, beta 1 among 24", "1",
         *(cell(mode, "rank in cycles of alpha 2 beta 1 rho 0.3 of 24") for mode in ("paper", "mmas"))],
    ]  # fmt: skip
    return table(["", "paper", "mode paper", "mode mmas"], rows)


def readings() -> str:
    """Mean cycles of every reading of what the ant colony paper leaves open."""
    r = Results("papers.ant_colony")
    rows = [
        [
            "Table 1, alpha 2, beta 1, rho 0.3",
            number(next(c.paper for c in r.starting("reading") if c.paper) or 0.0),
            "",
        ]
    ]
    for claim in r.starting("reading"):
        if claim.quantity.endswith("mean cycles"):
            words = claim.quantity.removeprefix("reading, ").removesuffix(": mean cycles")
            low, high = claim.interval or (claim.ours, claim.ours)
            rows.append([words, number(claim.ours), f"{number(low)} .. {number(high)}"])
    return table(["reading", "mean cycles", "95 % interval"], rows)


def prior() -> str:
    """What a certified optimum of bearings is worth, with and without a prior of positions."""
    r = Results("ambiguous_bearings")
    heads = ("targets found of each 100 there", "true tuples found", "chosen tuples that are true")

    def cell(claim: Claim) -> str:
        low, high = claim.interval or (claim.ours, claim.ours)
        return f"{claim.ours:.0f} ± {(high - low) / 2:.0f}{' %' if claim.unit else ''}"

    rows = []
    for case in (f"{targets} targets, {cost}" for targets in (5, 20) for cost in ("equation 5", "with a prior")):
        proven = f"{r[f'{case}: proven optima'].ours:.0f} %"
        rows.append([case, *(cell(r[f"{case}: {head}"]) for head in heads), proven])
    return table(["scene, cost", *heads, "proven optima"], rows)


def recordings_speed() -> str:
    """Plots a second and memory of recordings."""
    r = Results("scale.recordings")
    rows = []
    for run in labels(r, ": memory"):
        rate, memory = r[f"{run}: plots a second"], r[f"{run}: memory"]
        goals = number((rate.band or (0.0,))[0] or 0.0), number((memory.band or (0.0, 0.0))[1] or 0.0)
        rows.append([run, _judged(rate), goals[0], _judged(memory), goals[1]])
    text = table(["tracker, recording", "plots/s", "goal, at least", "MB", "goal, at most"], rows)
    return f"{text}\n\nBold: goal missed."


TABLES = {
    "recordings-speed": recordings_speed,
    "paper-setting": paper_setting,
    "fuzzy": fuzzy,
    "phases": phases,
    "speed": speed,
    "speed-ratios": speed_ratios,
    "batch": batch,
    "traffic": traffic,
    "ant-colony": ant_colony,
    "readings": readings,
    "large-components": partial(
        _plain, "large_components", "problems",
        ("tuples", "exact, s", "slowest, s", "others / exact", "least ratio"),
    ),
    "scale-scans": scale_scans,
    "scale-trackers": scale_trackers,
    "ghost-rankings": ghost_rankings,
    "probabilities": partial(
        _plain, "probabilities", "",
        ("mean width", "seconds", "estimate, seconds", "estimate, mean off longer runs",
         "estimate, furthest off longer runs"),
    ),
    "probabilities-beside": probabilities_beside,
    "prior": prior,
}  # fmt: skip
