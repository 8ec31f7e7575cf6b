"""What of the five papers is where, and whether it holds: the tables of docs/papers.md, every element a row.

The rows are written in papers/*.md, what stands in braces there is Python: of a function's names here, and of verdicts.
"""

import re
from pathlib import Path
from statistics import median

from experiments.benchmarks.rows import load
from experiments.common.claims import Claim
from experiments.common.results import Results, number, table
from experiments.pages.verdicts import CHANGES, FOLDER, filled, interval, verdict
from experiments.papers.dubins_enkf.ensemble import Q_SIGMA, R_SIGMA
from experiments.papers.modified_ekf.paper_setting import STEPS, Q

TABLE = Path(__file__).parents[2] / "docs" / "benchmarks.csv"


def changed() -> str:
    """How many rows later readings changed."""
    head, counts = ["paper", "rows", *CHANGES], {}
    for path in sorted(FOLDER.glob("*.md")):
        rows = path.read_text(encoding="utf-8").splitlines()[2:]
        counts[path.stem] = [len(rows), *(sum(row.split(" | ")[3].strip() == kind for row in rows) for kind in CHANGES)]
    counts["all"] = [sum(column) for column in zip(*counts.values(), strict=True)]
    return table(head, [[name.replace("-", " "), *map(str, row)] for name, row in counts.items()])


def ant_colony() -> str:
    """The ant colony paper."""
    r = Results("papers.ant_colony")
    cycles = r["mode paper: mean cycles over all settings"]
    greater = r["mode paper: cycles, alpha > beta less the others, whole interval below 0"]
    quick = r["mode paper: rank in time of alpha 2 beta 1 rho 0.3 of 24"]
    rank = r["mode paper: rank in cycles of alpha 2 beta 1 rho 0.3 of 24"]
    settings = [c for c in r.starting("setting") if c.quantity.endswith("mode paper: mean cycles to convergence")]
    alone = r.starting("truth, mode paper: false alarms left alone")[0]
    seen, all_saw = (r.starting(f"truth, mode paper: targets seen by {n}")[0] for n in (2, 3))
    greedy = r.starting("truth, greedy: scans of")[0]
    paper_solved = r.starting("truth, mode paper: scans of")[0]
    readings = [c for c in r.starting("reading, ") if c.quantity.endswith(": mean cycles")]
    nearest = min(readings, key=lambda c: abs(c.ours - (c.paper or 0.0)))
    reading = nearest.quantity.removeprefix("reading, ").removesuffix(": mean cycles")
    solver = r[f"solver, reading {reading}: mean cycles"]
    late = r.starting(f"{readings[0].quantity.removesuffix(': mean cycles')}: runs of")[1]
    limit = r["mode paper: runs cut off at the limit of cycles"]
    same = r["ties: tuples of two or three measurements that cost the same as another"]

    def of_runs(claim: Claim) -> str:
        return claim.quantity.split("runs of ")[1].split()[0]

    def until(words: str) -> str:
        cut = r.starting(f"reading, {words}: runs of")[0]
        mean = r[f"reading, {words}: mean cycles"].ours
        return f"{mean:.0f} ({cut.ours:.0f} of {of_runs(cut)} runs cut off at 1,000)"

    states = Results("papers.ant_colony.states")

    def state(what: str) -> str:
        return number(states[what].ours)

    return filled("ant-colony", locals(), _of=_of, _excess=_excess)


def _of(claim: Claim) -> str:
    """Of how many a share is: the last word of the claim's name."""
    return claim.quantity.rpartition(" of ")[2]


def _excess(solver: str, size: str) -> str:
    """Median excess over the optimum in the family ghost of docs/benchmarks.csv, percent."""
    rows = [row for row in load(TABLE) if (row.family, row.size, row.solver) == ("ghost", size, solver)]
    return number(100.0 * median(row.excess for row in rows), 2)


def clustering_time_window() -> str:
    """The thesis on the clustering time window."""
    r = Results("papers.clustering_time_window")
    t = Results("papers.clustering_time_window.tables")
    groups = [t[f"table 4.{n}: plots of our window {n} in it"] for n in (1, 2, 3)]
    twice = [t[f"table 4.{n}: aircraft that are in the group twice"] for n in range(1, 9)]
    turn = t["table 2.1: rotation time estimated"]
    heading, grid = t.starting("headings")[0], t.starting("positions of tables")[0]
    places = t["aircraft 2428: places in its track without the window"]
    better = t["aircraft of the five whose plots the window's track holds more of"]
    noise = t.starting("table 4.24")[0]
    gain = r["CT gained by the window with constant step, Reid's MHT"]
    o = Results("papers.clustering_time_window.own_tracker")
    falls, fell = r.starting("MT of the last three rows")[0], o["recordings in which MT falls by 20 points or more"]
    judged, most = o["recordings judged"], o.starting("largest fall of MT")[0]
    at_10 = t["table 2.1: aircraft twice in one of our windows of 10 s"]
    reid = {misses: f"Reid's MHT, constant step, {misses} misses" for misses in (3, 5, 8)}
    oriented = "track-oriented MHT, time stamps"

    def together(what: str, tracker: str = "") -> str:
        suffix = f", times chosen by us, {tracker}" if tracker else ""
        return f"{t[f'five aircraft: {what}{suffix}'].ours:.0f}"

    def by_misses(what: str) -> str:
        return ", ".join(together(what, name) for name in reid.values())

    anew = "times that our track ends and another begins"

    rates = {key: [r[f"{rate}, Reid's MHT, {key}"] for rate in ("CT", "MT", "IT")]
             for key in ("irregular groups", "CTW")}  # fmt: skip
    ours = {key: ", ".join(number(claim.ours) for claim in claims) for key, claims in rates.items()}
    paper = {key: ", ".join(number(claim.paper or 0.0) for claim in claims) for key, claims in rates.items()}
    pairs = {name: r.starting(f"{name}: pairs without an identity switch, MHT")[0]
             for name in ("crossing", "parallel", "head-on")}  # fmt: skip
    loss = r.starting("false start, at the same place: lost by it, first")[0]
    alone = {}
    for name in pairs:
        three, five, swapped = (
            o[f"{name}: pairs {what}, {reid[misses]}"]
            for what, misses in (("without a switch", 3), ("without a switch", 5), ("with a swap", 3))
        )
        unmissed = o[f"{name}: pairs in which neither aircraft is missed in 3 windows running"]
        these, others = (o[f"{name}: of {who} without a switch, {reid[3]}"] for who in ("these", "the others"))
        alone[name] = (
            f"{verdict(five)} with the thesis's own tracker (Reid, constant step) if tracks end "
            f"after 5 misses (the thesis gives no number): no switch in {number(five.ours, 2)} % of our pairs "
            f"({interval(five)}); after 3 in {number(three.ours, 2)} % ({interval(three)}), "
            f"{number(swapped.ours, 2)} % swapped, the rest begun anew: in {number(unmissed.ours, 2)} % neither "
            f"aircraft is missed three windows running, and of these {number(these.ours, 3)} % have no switch, of the "
            f"others {number(others.ours, 2)} %. What is lost is lost to misses"
        )
    strays = {name: r.starting(f"{name}: changes of track from plot to plot")[0] for name in pairs}
    near_targets, cited = Results("trackers.close_targets"), Results("papers.clustering_time_window.cited")
    imm, less = ([cited[f"{rate}, MHT, CTW, time stamps, {name}"] for rate in ("CT", "MT", "IT")]
                 for name in ("IMM", "IMM less EKF"))  # fmt: skip

    def close(kind: str) -> str:
        errors, switched = (
            [near_targets[f"{kind}, {name}: {what}"].ours for name in ("mht", "joint-probabilistic")]
            for what in ("GOSPA", "switches")
        )
        return (f"{kind} {' and '.join(number(one) for one in errors)}, "
                f"{' and '.join(number(one, 2) for one in switched)}")  # fmt: skip

    beside = {"parallel": " (1694 and 3673), which begin 25 nmi apart (table 4.1), ours fly 5 nmi apart"}
    m = Results("papers.clustering_time_window.spanning_tree")
    place = "false start, at the same place: "
    own_first = next(c for c in o.starting(f"{place}tracks that begin") if reid[3] in c.quantity)
    own_right = next(c for c in o.starting(f"{place}tracks whose identity is right") if reid[3] in c.quantity)
    own_loss = next(c for c in o.starting(f"{place}lost by it, first") if reid[3] in c.quantity)
    straight = o.starting("straightness: mean change of direction from position to position, smoothed")

    by_angle = "whole seconds, windows by the antenna's angle, 10 s"

    def bends(name: str) -> str:
        return number(o[f"straightness: mean change of direction from position to position, {name}"].ours, 2)

    def clock(name: str) -> str:
        twice = o[f"{name}: plots of aircraft that the window has already"]
        ct = o[f"{name}: CT, Reid's MHT, constant step"]
        return f"{number(twice.ours, 2)} % second plots of an aircraft in a window, CT {number(ct.ours)} %"

    lost = r.starting("false start, at the same place: tracks whose identity is right")
    weak = min(lost, key=lambda claim: claim.ours)
    first = " and ".join(number(c.ours, 2) for c in r.starting("false start, at the same place: tracks that begin"))

    def held(name: str, identity: int, what: str = "plots of") -> str:
        return f"{next(c for c in t.starting(f'aircraft {identity}: {what}') if name in c.quantity).ours:.0f}"

    aircraft = (902, 2467, 903, 958, 2428)
    known = [t.starting(f"aircraft {a}: plots of its")[0].quantity for a in aircraft]
    every = ", ".join(re.findall(r"of its (\d+)", text)[0] for text in known)
    flown = [
        f"{alone[name]}. With the track-oriented tracker and time stamps {number(pairs[name].ours, 2)} % have no "
        f"switch ({interval(pairs[name])}), {number(strays[name].ours, 2)} changes of track from plot to plot in a "
        f"pair, single plots gone astray included. The thesis has pictures of one pair{beside.get(name, '')}"
        for name in pairs
    ]
    return filled("clustering-time-window", locals())


def modified_ekf() -> str:
    """The modified EKF."""
    r, b = Results("papers.modified_ekf"), Results("papers.modified_ekf.beyond")

    ratio = {reading: r[f"simulation 1, reading {reading}: modified / EKF, RMSE of the position"]
             for reading in ("sigmas", "R_k", "mixed", "moving", "printed", "printed, mixed")}  # fmt: skip
    steep = [c for c in r.claims if "largest |phi~ tan phi|" in c.quantity]
    positions = [[r[f"simulation 1, reading mixed: RMSE of {axis}, {name}"] for name in ("EKF", "modified")]
                 for axis in "xyz"]  # fmt: skip
    ours = [number(short.ours / plain.ours, 2) for plain, short in positions]
    printed = [number((short.paper or 0.0) / (plain.paper or 1.0), 2) for plain, short in positions]
    larger = [claim.ours / (claim.paper or 1.0) for pair in positions for claim in pair]
    small, large = (
        r[f"simulation 1: {size} printed RMSE of the modified EKF, x 100"] for size in ("smallest", "largest")
    )
    ends = [r[f"simulation 2: {axis} of the target after 100 steps"] for axis in "xyz"]
    # the interval is two standard deviations about the end that the model gives from the given start
    given = [sum(claim.interval or ()) / 2 for claim in ends]
    errors = [r[f"simulation 2: error of {axis} after 100 steps, EKF"] for axis in "xyz"]
    b1 = [c for c in r.starting("B1") if c.holds is not None]
    nees = [r[f"B1: NEES of the {name} (ideal 6)"] for name in ("EKF", "full modified EKF")]
    variables = []
    for variable in ("x", "y", "z", "Vx", "Vy", "Vz"):
        claims = [r[f"simulation 1, reading {reading}: RMSE of {variable}, {name}"]
                  for reading in ("sigmas", "R_k", "mixed") for name in ("EKF", "modified")]  # fmt: skip
        by_sigmas, by_r, by_both = (
            f"{number(plain.ours)}, {number(short.ours)}"
            for plain, short in zip(claims[::2], claims[1::2], strict=True)
        )
        variables.append(f"{verdict(*claims)}: EKF, modified {by_sigmas} (sigmas), {by_r} (R_k), {by_both} (mixed) "
                         f"against {number(claims[0].paper or 0.0)}, {number(claims[1].paper or 0.0)}")  # fmt: skip
    debiased = b.starting("debiased measurements: largest error")
    missed, plane = (b[f"{name}: full modified EKF / EKF (RMSE)"] for name in ("B1, P_d 0.7",
                                                                             "B1 in the plane, Radar2D"))  # fmt: skip
    ukf = b["B1 in the plane, Radar2D: full modified EKF / UKF (RMSE)"]
    kalman = [c for c in b.claims if "Kalman filter of converted" in c.quantity]
    products, (jacobian,) = b.starting("state-space matrices: largest"), b.starting("state-space matrices: A")
    return filled("modified-ekf", locals(), Q=Q, STEPS=STEPS)


def fuzzy_ekf() -> str:
    """The fuzzy-adaptive EKF."""
    r = Results("papers.fuzzy_ekf")
    scenarios = "CDEFGH"

    def span(claims: list[Claim]) -> str:
        values = [claim.ours for claim in claims]
        return f"{number(min(values))} to {number(max(values))}"

    raw = [r[f"{s}: RMSE, raw measurements"] for s in scenarios]
    plain = [r.starting(f"{s}: RMSE, best fixed EKF of constant acceleration")[0] for s in scenarios]
    rules = [r[f"{s}: RMSE, the paper's rules, tuned sets"] for s in scenarios]
    literal = [r[f"{s}: RMSE, Q_0, R_0 and P_0 taken literally, EKF"] for s in scenarios]
    gained = [r[f"{s}: best fixed EKF of constant acceleration, below the raw measurements"] for s in scenarios]
    below = [r[f"{s}: the paper's rules, tuned sets, below the raw measurements"] for s in scenarios]
    printed = [
        r[f"{s}: RMSE, Q_0, R_0 and P_0 taken literally, with rules"].ours / one.ours
        for s, one in zip(scenarios, literal, strict=True)
    ]
    # in every scenario the best of velocity and acceleration is one of velocity
    slow = [r.starting(f"{s}: RMSE, best fixed EKF (velocity")[0].ours / one.ours
            for s, one in zip(scenarios, plain, strict=True)]  # fmt: skip
    once = Results("papers.fuzzy_ekf.tuned_once")
    single, named = (
        [once[f"{s}: the paper's rules, {sets} / EKF of constant acceleration tuned once"] for s in scenarios]
        for sets in ("tuned sets", "sets as named")
    )
    current = [once[f"{s}: the paper's rules, tuned sets, alpha with R_k / with R_0"].ours for s in scenarios]
    free, held, zero = (
        " and ".join(f"{noise} = {number(once[f'{sets}: {noise} at alpha = {alpha}'].ours)}" for noise in "qr")
        for sets, alpha in (("tuned sets", 1), ("sets as named", 1), ("tuned sets", 0))
    )
    models = Results("papers.fuzzy_ekf.other_models")

    def against_acceleration(model: str) -> list[str]:
        return [number(models[f"{s}: EKF, model {model} / constant acceleration, each tuned once"].ours)
                for s in scenarios]  # fmt: skip

    against = [r[f"{s}: the paper's rules, tuned sets / best fixed EKF of constant acceleration"] for s in scenarios]
    least = min(against, key=lambda claim: (claim.interval or (0.0, 1.0))[1])
    return filled("fuzzy-ekf", locals())


def dubins_enkf() -> str:
    """Dubins paths and the ensemble Kalman filter."""
    r = Results("papers.dubins_enkf")
    points = r.starting("with obstacle: x of the") + r.starting("with obstacle: y of the")
    srs = [r["with obstacle: radius of the turn of the paper's SRS path"], *r.starting("with obstacle: kink")]
    flown = r.starting("with obstacle: length of the shortest path that can be flown")[0]
    best = r["without obstacle: shortest of the paper's four words, less RSR"]
    fixed, other = r.starting("fixed attack, N 300: RMS"), r.starting("changing attack, N 100: RMS")
    third, treble = (
        r.starting(f"fixed attack, N 300, {words} the process noise") for words in ("a third of", "three times")
    )
    members = {
        label: r.starting(f"{label}: N {size} / N") for label, size in (("fixed attack", 300), ("changing attack", 200))
    }
    measured = [c for c in r.starting("RMS of") if c.holds is not None]
    high = r["RMS of height: measuring x / all"]
    as_printed = r.starting("equation 1 as printed, N 300")
    under = [c for c in r.claims if "runs that come below the ground" in c.quantity]
    lost = r.starting("speed after a step by equation 21")[0]
    longer = {figure: [number(c.ours, 2) for c in r.starting(f"between the ends of {figure}")]
              for figure in ("figure 2", "figure 3")}  # fmt: skip

    def times(pair: str) -> str:
        return " and ".join(f"{number(c.ours)} ({interval(c)})" for c in measured if pair in c.quantity)

    speeds = [c for c in r.claims if "speed of all runs" in c.quantity]
    noises = R_SIGMA / Q_SIGMA
    heights = " and ".join(number(r[f"{kind} attack: least height of all runs"].ours) for kind in ("fixed", "changing"))
    lengths = {word: number(r[f"without obstacle: length of {word}"].ours, 4) for word in ("RSR", "LSR", "RSL", "LSL")}

    two_radii = {
        word: number(r[f"r_s 100, r_f 50 m: length of {word} by the paper's steps"].ours, 4) for word in lengths
    }
    steps, thrust = r.starting("r_s = r_f: largest difference")[0], r["thrust"]
    loads = [c.ours for c in r.claims if "L / (m g)" in c.quantity]
    tangent = r["with obstacle: heading of that path at the printed points"]

    path = Results("papers.dubins_enkf.along_path")

    def along(what: str, label: str = "N 300") -> str:
        figures = ("figure 2, RSR", "figure 3, around the obstacle")
        return " and ".join(number(path[f"{figure}, {label}: RMS, {what}"].ours) for figure in figures)

    shares = [claim.ours / noise for claim, noise in zip(fixed, R_SIGMA, strict=True)]

    def sizes(label: str) -> str:
        return ", ".join(number(claim.ours) for claim in members[label])

    def beside(claims: list[Claim]) -> str:
        return ", ".join(f"{number(c.ours)} ({number(c.paper or 0.0)})" for c in claims)

    return filled("dubins-enkf", locals())


TABLES = {
    "rows-changed": changed,
    "papers-ant-colony": ant_colony,
    "papers-clustering-time-window": clustering_time_window,
    "papers-modified-ekf": modified_ekf,
    "papers-fuzzy-ekf": fuzzy_ekf,
    "papers-dubins-enkf": dubins_enkf,
}
