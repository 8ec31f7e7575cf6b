"""What of the five papers is where, and whether it holds: the tables of docs/papers.md, every element a row."""

from pathlib import Path
from statistics import median

from experiments.benchmarks.rows import load
from experiments.common.claims import Claim
from experiments.common.results import Results, number, table
from experiments.pages.coverage_time_window import clustering_time_window
from experiments.pages.verdicts import (
    ABSENT,
    CHANGES,
    FOLDER,
    HOLDS,
    NOT,
    at_the_edge,
    below_one,
    filled,
    interval,
    verdict,
)
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
    sweep = Results("metaheuristics.sweep")
    many = {n: sweep.starting(f"ghosts {n}, paper: table 1's advice")[0] for n in (20, 40)}
    return filled("ant-colony", [
        f"{verdict(*settings)}: {number(cycles.ours)} on average of the settings ({interval(cycles)}) against "
        f"{number(cycles.paper or 0.0)}, the mean of table 1; nearest of the readings of what is left open: "
        f"{number(nearest.ours)} ({interval(nearest)}) against {number(nearest.paper or 0.0)}, {reading}",
        f"{ABSENT}, not shown either way: {number(greater.ours, 2)} cycles ({interval(greater)}), all of it from the "
        f"settings with alpha = 1; in table 1 {number(greater.paper or 0.0, 2)}",
        f"{ABSENT}, nothing to show: all settings find the optimum of every scan; so does greedy on "
        f"{greedy.ours:.0f} of 100",
        f"{verdict(quick)}: place {number(quick.ours, 2)} of 24 by time ({interval(quick)}), as the paper means it, "
        f"{number(rank.ours, 2)} by cycles ({interval(rank)})",
        f"{verdict(alone, all_saw)}, on one run of the scene: {number(alone.ours)} % of {_of(alone)} false alarms are "
        f"left alone; of {_of(all_saw)} targets that all 3 radars saw {number(all_saw.ours)} % are found with just "
        "these measurements. A target that one radar alone saw is taken for a false alarm, by our reading of "
        "equation 5",
        f"{verdict(seen)}, on one run: {number(seen.ours)} % of {_of(seen)} targets that only 2 radars saw are found "
        "with just these measurements",
        f"{verdict(paper_solved)}: {paper_solved.ours:.0f} of 100 scans to the optimum, with its three targets. The "
        "paper has no comparison with it, and no scene of the many targets that the conclusion names: on ghosts of "
        f"20 and 40 targets its rho, alpha and beta end {number(many[20].ours, 2)} ({interval(many[20])}) and "
        f"{number(many[40].ours, 2)} % ({interval(many[40])}) above it",
        f"{ABSENT} of that problem; on ghosts of 20 and 40 targets annealing as in `docs/own_solver.md` ends "
        f"{' and '.join(_excess('annealing', size) for size in ('20', '40'))} % above the optimum (median), greedy "
        f"{' and '.join(_excess('greedy', size) for size in ('20', '40'))} %; the genetic algorithm "
        f"{' and '.join(_excess('genetic', size) for size in ('20', '40'))} %, tabu search "
        f"{' and '.join(_excess('tabu', size) for size in ('20', '40'))} % and the ants "
        f"{' and '.join(_excess('aco', size) for size in ('20', '40'))} %. These three share dives in the linear "
        "program and local search, which annealing has not: it is no comparison of the four ideas",
    ])  # fmt: skip


def _of(claim: Claim) -> str:
    """Of how many a share is: the last word of the claim's name."""
    return claim.quantity.rpartition(" of ")[2]


def _excess(solver: str, size: str) -> str:
    """Median excess over the optimum in the family ghost of docs/benchmarks.csv, percent."""
    rows = [row for row in load(TABLE) if (row.family, row.size, row.solver) == ("ghost", size, solver)]
    return number(100.0 * median(row.excess for row in rows), 2)


def modified_ekf() -> str:
    """The modified EKF."""
    r, b = Results("papers.modified_ekf"), Results("papers.modified_ekf.beyond")

    ratio = {reading: r[f"simulation 1, reading {reading}: modified / EKF, RMSE of the position"]
             for reading in ("sigmas", "R_k", "mixed", "moving")}  # fmt: skip
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
    products, (jacobian,) = b.starting("state-space matrices: largest"), b.starting("state-space matrices: A")
    return filled("modified-ekf", [
        f"{verdict(*debiased)} with the terms corrected (third rows of 2.17 and 2.18: sin phi; 2.19: C13; 2.24: T' "
        "on the right, and its entry 2, 3; short form of R_c, which is not sampled: sigma_theta^4): mean and "
        f"covariance against a million samples. The plain conversion is off by "
        f"{number(b.starting('debiased measurements: bias')[0].ours, 2)} standard deviations there. The filter does "
        "not use them: it debiases the residual",
        f"{NOT}: an overconfident filter has it, too. On B1, chosen by us, the EKF's NEES is {number(nees[0].ours)} "
        f"(ideal 6), the modified filter's {number(nees[1].ours)}",
        *variables,
        f"{NOT} with the paper's model: ratio {number(ratio['sigmas'].ours)} (sigmas), {number(ratio['R_k'].ours)} "
        f"(R_k) against {number(ratio['sigmas'].paper or 0.0, 2)} by table 4.3. Two readings that are not the paper's "
        f"are below 1: {number(ratio['moving'].ours)} ({interval(ratio['moving'])}) if the target moves, "
        f"{number(ratio['mixed'].ours)} ({interval(ratio['mixed'])}, without the paper's) if the EKF alone is given "
        "R_k, with x, y, z "
        f"{' '.join(ours)} against {' '.join(printed)} and errors {number(min(larger), 2)} to {number(max(larger), 2)} "
        "times the paper's",
        f"{verdict(small, large)}: they are RMSE x 100 in metres, and table 4.3 has {number(small.ours)} and "
        f"{number(large.ours)}, the one of y in m, the other of Vx in m/s; the text's upper end, 0.0115598, is the "
        "EKF's Vz. Those of the EKF likewise",
        f"{NOT} from the given start: the model ends at {', '.join(number(end, 4) for end in given)} m, with a "
        f"standard deviation of {number((STEPS * Q) ** 0.5, 2)} m by Q, against "
        f"{', '.join(number(c.paper or 0.0, 4) for c in ends)}. With the start drawn with P_0 it {verdict(*ends)}, "
        "within two standard deviations",
        f"{verdict(*errors)}: with x, y, z measured with R_k the errors after 100 steps are "
        f"{', '.join(number(c.ours, 2) for c in errors)} m (RMSE), figure 4.9 less figure 4.8 is "
        f"{', '.join(number(c.paper or 0.0, 2) for c in errors)}",
        f"{NOT} in the paper's setting; {verdict(*b1)} on B1, chosen by us: {number(b1[0].ours)} times the EKF's error "
        f"({interval(b1[0])})",
        f"{verdict(*products)} as products with the state: they give equations 4.7 to 4.14 (to rounding), the first "
        "but for z = 0, the second for x = 0, by which they divide. Their entries depend on the state: the model is "
        "not linear, as section 1.3 says that it is, and A of section 4.1.2 not the Jacobian, from whose change in a "
        f"step its own differs by {number(100 * jacobian.ours, 2)} % around the start of table 4.1",
        f"{verdict(plane, ukf)} for a radar of range and azimuth: {number(plane.ours)} times the error of the EKF "
        f"({interval(plane)}), {number(ukf.ours)} times a UKF's, on B1 in the plane, chosen by us",
        f"{ABSENT} in the paper; here a prediction without a correction: {number(missed.ours)} times the error of the "
        f"EKF ({interval(missed)}) on B1 with P_d 0.7, chosen by us",
    ])  # fmt: skip


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
    return filled("fuzzy-ekf", [
        f"{HOLDS}, but for S of equation 35 in alpha: with R_0, where the paper has R_k. With R_k, scaled by the r "
        "of the measurement before (r_k itself follows from alpha), and the tuned sets the errors are "
        f"{', '.join(number(ratio) for ratio in current)} times as large in C to H",
        f"{NOT} with sets tuned by us: alpha = 1 gives {free}, alpha = 0, which the rules call near zero, {zero}, so "
        "that no alpha lowers them: the tuning is not held to the names of the sets. Sets held to their names give "
        f"{held} at alpha = 1",
        f"{ABSENT}: its flight is not given; ours are six manoeuvres chosen by us, with the angle noise that makes "
        f"the raw RMSE the paper's ({span(raw)} m), and one run of the first is drawn",
        f"{NOT} taken literally, in km and rad: {span(literal)} m without rules, worse than the raw measurements",
        f"{NOT} on our flights, which are not the paper's: {span(plain)} m, the best of a grid for each",
        f"{NOT} on our flights: {span(gained)} %",
        f"{NOT} on our flights: {span(rules)} m",
        f"{verdict(*below)} on our flights: {span(below)} %",
        f"{below_one(against)} scenarios with its whole interval: "
        f"{', '.join(number(c.ours) for c in against)} times the error, in C to H, of the fixed EKF of the same model "
        "that is best for each in hindsight; against 0.69 in the paper",
        f"{below_one(single)} scenarios with its whole interval: {', '.join(number(c.ours) for c in single)} times its "
        "error in C to H, a few percent either way; against 0.69 in the paper. Sets held to their names: "
        f"{', '.join(number(c.ours) for c in named)}",
        f"{ABSENT} in the paper, which names them: EKFs tuned once on the same flights have "
        f"{', '.join(against_acceleration('Singer'))} (Singer) and {', '.join(against_acceleration('jerk'))} (jerk) "
        "times the error of constant acceleration in C to H",
    ])  # fmt: skip


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

    return filled("dubins-enkf", [
        f"{ABSENT}: the paper gives no values. Those of the published aircraft are 200 to 310 m/s and 1,000 to 6,000 "
        f"N: in our two simulations speeds are {number(min(c.ours for c in speeds))} to "
        f"{number(max(c.ours for c in speeds))} m/s, above the limit in both, the thrust chosen by us "
        f"{number(thrust.ours)} N; L / (m g) is {number(min(loads), 2)} to {number(max(loads), 2)}",
        f"{ABSENT} as a limit: none is given; with the noise chosen by us the least heights are {heights} m",
        f"{verdict(steps)}: the paper's steps with r_s = r_f, as in both simulations, give our four lengths (to "
        "rounding); the package has one radius. With r_s 100 and r_f 50 m the steps give "
        + ", ".join(f"{word} {value}" for word, value in two_radii.items()) + " m",
        f"{HOLDS} for 14, arcs and tangent; 15 and 16, which differentiates it, are not legible in our copy. The "
        "paper prints no length; ours in m: "
        + ", ".join(f"{word} {value}" for word, value in lengths.items()),
        f"{verdict(best)} with headings from the x axis, as the points of figure 3 need; the text says from the "
        "y axis, where it does not hold",
        f"{verdict(*points)}: as tangent points of another RSL path, on which the heading is {number(tangent.ours)} "
        "deg there, not the printed pi / 3 and 0",
        f"{verdict(*srs)} as a path that can be flown: it turns at the obstacle's 30 m, where the radius is 100, and "
        f"has kinks of {' and '.join(number(c.ours, 2) for c in srs[1:])} deg against the printed headings; the "
        f"shortest that can be flown has {number(flown.ours, 4)} m",
        f"{ABSENT} in the paper, whose filter flies on a model of height and speed. An aircraft that steers by its "
        f"estimate along the paths of figures 2 and 3, noise chosen by us, is seen {along('estimate from the path')} m "
        f"from the path (RMS, N 300; EKF {along('estimate from the path', 'EKF')}, within chance), and "
        f"{along('estimate from the aircraft')} m from where it is",
        f"{verdict(best)} without an obstacle, among the paper's four words; {verdict(*srs)} with one: figure 3 cannot "
        "be flown",
        f"{verdict(*fixed)} within 10 %, chosen by us ({at_the_edge(*fixed)}), and built in: ours (paper's) "
        f"{beside(fixed)}, process noise chosen as the paper's errors, measurement noise as {number(min(noises), 3)} "
        f"to {number(max(noises), 3)} times that; start (272 m/s) and step (0.0167 s) are chosen by us, too",
        f"{verdict(*third)}: {beside(third)}",
        f"{verdict(*treble)}: {beside(treble)}",
        f"{verdict(*other)} within 10 % ({at_the_edge(*other)}), built in like the first: {beside(other)}; "
        "noise and the course of the attack are chosen by us. The speed's error is printed 18291",
        f"{verdict(*members['fixed attack'])}: of 100, 200 and 500 members' errors those of 300 are "
        f"{sizes('fixed attack')} times; 0.98 and less would be better, chosen by us",
        f"{verdict(*members['changing attack'])}: of 100, 300 and 500 members' errors those of 200 are "
        f"{sizes('changing attack')} times; the text itself uses 100",
        f"{verdict(*measured)} for climb angle and speed: with x and h alone their errors are "
        f"{' and '.join(number(c.ours) for c in measured if 'x, h / all' in c.quantity)} times as large, with x alone "
        f"{' and '.join(number(c.ours) for c in measured if 'x / x, h' in c.quantity)} times those, and the height's "
        f"{number(high.ours)} times that with all",
        f"{ABSENT}: without the paper's noise near has no measure. With ours the errors are "
        f"{number(min(shares), 2)} to {number(max(shares), 2)} times the standard deviations of the measurements "
        "(fixed attack, N 300)",
        f"{NOT} together: of the same errors section d says \"far apart\" (terpaut jauh) and the conclusion \"near\"",
    ])  # fmt: skip


TABLES = {
    "rows-changed": changed,
    "papers-ant-colony": ant_colony,
    "papers-clustering-time-window": clustering_time_window,
    "papers-modified-ekf": modified_ekf,
    "papers-fuzzy-ekf": fuzzy_ekf,
    "papers-dubins-enkf": dubins_enkf,
}
