"""What of the five papers is where, and whether it holds: the tables of docs/papers.md, every element a row."""

from typing import NamedTuple

from experiments.common.claims import Claim
from experiments.common.results import Results, number, table

TABLES_PROGRAM = "experiments/papers/clustering_time_window/tables.py"
TRAFFIC = "experiments/papers/clustering_time_window/traffic.py"
FALSE_START = "experiments/papers/clustering_time_window/false_start.py"
PAIRS = "experiments/papers/clustering_time_window/pairs.py"
TABLE_1 = "experiments/papers/ant_colony/__main__.py"
TRUTH = "experiments/papers/ant_colony/truth.py"
UNIT_RATES = "assoc/filters/motion/unit_rates.py"
HOLDS, NOT, ABSENT = "holds", "does not hold", "absent"


class Row(NamedTuple):
    """One element of a paper.

    element: Equation, table, figure or conclusion.
    where: Path of the code or experiment.
    result: Whether it holds, and with which figures or why not.
    command: What shows it.
    """

    element: str
    where: str
    result: str
    command: str


def verdict(*claims: Claim) -> str:
    """Whether all of the claims hold."""
    good = sum(claim.holds is True for claim in claims)
    judged = sum(claim.holds is not None for claim in claims)
    if good == judged:
        return HOLDS
    return NOT if good == 0 else f"holds in {good} of {judged}"


def near(*claims: Claim, share: float = 0.1) -> str:
    """Whether claims are within a share of the paper's numbers, chosen by us."""
    good = sum(abs(c.ours - c.paper) <= share * abs(c.paper) for c in claims if c.paper is not None)
    if good == len(claims):
        return HOLDS
    return NOT if good == 0 else f"holds in {good} of {len(claims)}"


def interval(claim: Claim) -> str:
    """The interval of a claim in words."""
    low, high = claim.interval or (claim.ours, claim.ours)
    return f"95 % interval {number(low, 2)} to {number(high, 2)}"


def test(path: str) -> str:
    """The command that runs a test file."""
    return f"`pytest {path}`"


def run(name: str) -> str:
    """The command that runs an experiment."""
    return f"`python -m experiments.{name}`"


def rendered(rows: list[Row]) -> str:
    """The rows as a table."""
    body = [[row.element, f"`{row.where}`" if row.where else "", row.result, row.command] for row in rows]
    return table(["element", "where", "result", "command"], body, lambda column: False)


def ant_colony() -> str:
    """The ant colony paper."""
    r, command = Results("papers.ant_colony"), run("papers.ant_colony")
    costs, aco = test("tests/costs/test_costs.py"), test("tests/experiments/test_ant_colony.py")
    cycles = r["mode paper: mean cycles over all settings"]
    greater = r["mode paper: cycles, alpha > beta less the others, whole interval below 0"]
    better = r["mode paper: certified optimal, alpha > beta less the others, whole interval above 0"]
    rank = r["mode paper: rank in cycles of alpha 2 beta 1 rho 0.3 of 24"]
    settings = [c for c in r.starting("setting") if c.quantity.endswith("mode paper: mean cycles to convergence")]
    alone = r.starting("truth, mode paper: false alarms left alone")[0]
    seen = r.starting("truth, mode paper: targets seen by 2")[0]
    greedy = r.starting("truth, greedy: scans of")[0]
    paper_solved = r.starting("truth, mode paper: scans of")[0]
    readings = [c for c in r.starting("reading, ") if c.quantity.endswith(": mean cycles")]
    nearest = min(readings, key=lambda c: abs(c.ours - (c.paper or 0.0)))
    reading = nearest.quantity.removeprefix("reading, ").removesuffix(": mean cycles")
    return rendered([
        Row("equations 1 to 3, likelihoods and cost", "assoc/costs/", f"{HOLDS}, with clutter density r / V", costs),
        Row("equation 4, position of greatest likelihood", "assoc/costs/estimation.py", HOLDS, costs),
        Row("equation 5, cost of a tuple", "assoc/costs/positions.py",
            f"{HOLDS}; false alarms cost 0 by our reading, else no measurement would be one", costs),
        Row("equation 6, assignment with its constraints", "assoc/problem.py", HOLDS,
            test("tests/solvers/test_against_brute_force.py")),
        Row("equation 7, visibility 1 / c", "assoc/solvers/aco/paper.py",
            f"{NOT} for the costs of equation 5, which are negative: a transform is needed (`visibility`)", aco),
        Row("equation 8, rule of transition", "assoc/solvers/aco/paper.py", HOLDS, aco),
        Row("equations 9 to 11, pheromone", "assoc/solvers/aco/paper.py",
            f"{HOLDS}, L of the transformed costs", aco),
        Row("first cycle, tabu list, stop when all tours are the same", "assoc/solvers/aco/paper.py", HOLDS, aco),
        Row("a tour of N = 1 + sum of n nodes", "assoc/solvers/aco/paper.py",
            f"{NOT}: a tour ends when no node is allowed", aco),
        Row("scene: targets, 3 radars, P_d, false alarms", "assoc/simulation/scenarios/three_radar.py",
            f"{HOLDS}; noise and region are not given and chosen by us", test("tests/simulation/")),
        Row("figures 1 and 2, targets and measurements", TRUTH, f"{HOLDS}: drawn; no numbers to compare", command),
        Row("figure 3, measurements selected", TRUTH, f"{HOLDS}: drawn; no numbers to compare", command),
        Row("table 1, mean cycles", TABLE_1,
            f"{verdict(*settings)}: {number(cycles.ours)} against {number(cycles.paper or 0.0)}; "
            f"nearest of the readings of what is left open: {number(nearest.ours)} against "
            f"{number(nearest.paper or 0.0)}, {reading}",
            command),
        Row("alpha > beta is quicker", TABLE_1,
            f"{verdict(greater)}: {number(greater.ours, 2)} cycles, {interval(greater)}; from alpha = 1 alone",
            command),
        Row("alpha > beta finds better solutions", TABLE_1,
            f"{verdict(better)}: all settings find the optimum of every scan; so does greedy on "
            f"{greedy.ours:.0f} of 100", command),
        Row("rho 0.3, alpha 2, beta 1 is quickest", TABLE_1,
            f"{verdict(rank)}: place {number(rank.ours, 2)} of 24", command),
        Row("conclusion: targets and false alarms are told apart", TRUTH,
            f"{verdict(alone)}: {number(alone.ours)} % of the false alarms are left alone", command),
        Row("abstract: missed detections are coped with", TRUTH,
            f"{verdict(seen)}: {number(seen.ours)} % of the targets that only 2 radars saw are found with just these "
            "measurements", command),
        Row("conclusion: the assignment problem can be solved", TRUTH,
            f"{verdict(paper_solved)}: {paper_solved.ours:.0f} of 100 scans to the optimum. The paper has no "
            "comparison with it", command),
    ])  # fmt: skip


def clustering_time_window() -> str:
    """The thesis on the clustering time window."""
    r, command = Results("papers.clustering_time_window"), run("papers.clustering_time_window")
    t, rebuild = Results("papers.clustering_time_window.tables"), run("papers.clustering_time_window.tables")
    reading, windows = test("tests/recordings/test_reading.py"), test("tests/recordings/test_windows.py")
    mht = test("tests/tracking/test_hypothesis_oriented.py")
    groups = [t[f"table 4.{n}: plots of our window {n} in it"] for n in (1, 2, 3)]
    twice = [t[f"table 4.{n}: aircraft that are in the group twice"] for n in range(1, 9)]
    heading, grid = t.starting("headings")[0], t.starting("positions of tables")[0]
    better = t["aircraft of the five whose plots the window's track holds more of"]
    noise = t.starting("table 4.24")[0]
    gain = r["CT gained by the window with constant step, Reid's MHT"]
    falls = r.starting("MT of the last three rows")[0]
    rates = {key: [r[f"{rate}, Reid's MHT, {key}"] for rate in ("CT", "MT", "IT")]
             for key in ("irregular groups", "CTW")}  # fmt: skip
    ours = {key: ", ".join(number(claim.ours) for claim in claims) for key, claims in rates.items()}
    paper = {key: ", ".join(number(claim.paper or 0.0) for claim in claims) for key, claims in rates.items()}
    pairs = {name: r.starting(f"{name}: pairs without an identity switch, MHT")[0]
             for name in ("crossing", "parallel", "head-on")}  # fmt: skip
    lost = r.starting("false start, at the same place: tracks whose identity is right")
    weak = min(lost, key=lambda claim: claim.ours)
    first = r.starting("false start, at the same place: tracks that begin")[0]
    figures = (("crossing", "4.18", "4.19"), ("parallel", "4.20", "4.21"), ("head-on", "4.22", "4.23"))

    def held(name: str, identity: int) -> str:
        which = ("without", "with", "ours").index(name)
        return f"{t.starting(f'aircraft {identity}: plots of its')[which].ours:.0f}"

    aircraft = (902, 2467, 903, 958, 2428)
    return rendered([
        Row("figure 2.1, coordinates", "assoc/recordings/recording.py", HOLDS, reading),
        Row("table 2.1, recording", "assoc/recordings/reading.py", f"{HOLDS}: read as printed", rebuild),
        Row("figure 2.2 and section 2.2.2, the window", "assoc/recordings/windows.py", HOLDS, windows),
        Row("figures 2.3 to 2.5, Reid's 28 hypotheses", "assoc/tracking/mht/hypothesis_oriented.py", HOLDS, mht),
        Row("section 2.2.4, Murty's m best", "assoc/tracking/mht/children.py", f"{HOLDS}; m is not given, 50 is ours",
            test("tests/tracking/test_clusters.py")),
        Row("section 2.2.5, F, H and R", "assoc/filters/motion/models.py",
            f"{HOLDS} with the state [x, x', y, y']: the printed order [x, y, x', y'] does not fit F", mht),
        Row("equation 2.1, probability of a hypothesis", "assoc/tracking/mht/hypothesis_oriented.py",
            f"{HOLDS} with N_d the targets detected, not the measurements", mht),
        Row("section 2.2.6, pruning, deletion after n misses", "assoc/tracking/life_cycle.py",
            f"{HOLDS}; n is not given, 3 chosen by us", mht),
        Row("figures 3.1 to 3.4, courses of the work", "assoc/track.py", f"{HOLDS}: the program follows them",
            test("tests/programs/test_track.py")),
        Row("equations 3.1 and 3.2, positions", TABLES_PROGRAM,
            f"{NOT}: {number(grid.ours)} % of the positions are x = 5/7 r sin b, y = -5/7 r cos b, in pixels",
            rebuild),
        Row("equations 3.3 to 3.6, distance and speed", "assoc/tracking/track_table.py",
            f"{NOT} as printed: equation 3.6 divides by a time where a difference is meant; the program gives the "
            "filter's speed",
            test("tests/programs/test_track.py")),
        Row("equations 3.7 and 3.8, heading", TABLES_PROGRAM,
            f"{verdict(heading)}: {number(heading.ours, 2)} % of the printed headings", rebuild),
        Row("tables 4.1 to 4.3, groups with the window", TABLES_PROGRAM,
            f"{verdict(*groups)}: plot by plot, as far as table 2.1 goes", rebuild),
        Row("tables 4.4 to 4.8, no aircraft twice with the window", TABLES_PROGRAM,
            verdict(*twice), rebuild),
        Row("tables 4.9, 4.11, 4.13, 4.15, 4.17, ground truth", TABLES_PROGRAM,
            f"{ABSENT} as a recording: they have no times, and gaps", rebuild),
        Row("tables 4.10, 4.12, 4.14, 4.16, 4.18, figures 4.1 to 4.5, without the window",
            TABLES_PROGRAM,
            f"{ABSENT} as a result of ours, without the recording; read again, plots held of the five: "
            f"{', '.join(held('without', one) for one in aircraft)}; our tracks "
            f"of the same plots, times chosen by us: {', '.join(held('ours', one) for one in aircraft)}", rebuild),
        Row("tables 4.19 to 4.23, figures 4.6 to 4.10, with the window",
            TABLES_PROGRAM,
            f"{ABSENT} likewise; plots held: {', '.join(held('with', one) for one in aircraft)}", rebuild),
        Row("figures 4.11 to 4.15, comparison; conclusion 2", TABLES_PROGRAM,
            f"{verdict(better)}: the window's track holds more in {better.ours:.0f} of the five", rebuild),
        Row("table 4.24 and conclusion 3, a false plot at the start", FALSE_START,
            f"{verdict(noise)}, and is the identity's fault: {number(first.ours, 2)} % of our tracks begin with the "
            f"aircraft's plot, {number(weak.ours)} % have the right identity by majority", command),
        Row("tables 4.25 to 4.27, figures 4.16 and 4.17, without", TRAFFIC,
            f"{near(*rates['irregular groups'])} within 10 %: CT, MT, IT {ours['irregular groups']} against "
            f"{paper['irregular groups']}, on other recordings", command),
        Row("the same, with the window; conclusion 1", TRAFFIC,
            f"{near(*rates['CTW'])} within 10 %: CT, MT, IT {ours['CTW']} against {paper['CTW']}", command),
        Row("the window's gain of CT", TRAFFIC,
            f"{verdict(gain)}: {number(gain.ours)} against {number(gain.paper or 0.0)} points", command),
        Row("table 4.25: MT falls over the recording", TRAFFIC,
            f"{verdict(falls)}: {number(falls.ours, 2)} against {number(falls.paper or 0.0, 3)} points", command),
        *(Row(f"figures {flat} and {deep}, {name}", PAIRS,
              f"{verdict(pairs[name])}: no switch in {number(pairs[name].ours, 2)} % of our pairs", command)
          for name, flat, deep in figures),
        Row("conclusions 1 and 2 on the thesis's recording", "", f"{ABSENT}: the recording is not public", ""),
        Row("appendix A, tracks of all aircraft", "", f"{ABSENT}: pictures without figures", ""),
        Row("appendix B, figures 1 to 7, program", "assoc/track.py",
            f"{HOLDS}: plots, aircraft, tracks, altitudes and CT, MT, IT in `assoc.track --report`",
            test("tests/programs/test_track.py")),
    ])  # fmt: skip


def modified_ekf() -> str:
    """The modified EKF."""
    r, command = Results("papers.modified_ekf"), run("papers.modified_ekf")
    modified, model = test("tests/filters/test_modified.py"), test("tests/filters/test_unit_rates.py")
    filters, sensors = test("tests/filters/test_gaussian_filters.py"), test("tests/sensors/")
    where = "experiments/papers/modified_ekf/paper_setting.py"

    def rows_of(variables: tuple[str, ...]) -> list[Claim]:
        return [r[f"simulation 1, reading {reading}: RMSE of {variable}, {name}"]
                for reading in ("sigmas", "R_k", "mixed") for variable in variables
                for name in ("EKF", "modified")]  # fmt: skip

    ratio = {reading: r[f"simulation 1, reading {reading}: modified / EKF, RMSE of the position"]
             for reading in ("sigmas", "R_k", "mixed", "moving")}  # fmt: skip
    small, large = (
        r[f"simulation 1: {size} printed RMSE of the modified EKF, x 100"] for size in ("smallest", "largest")
    )
    ends = [r[f"simulation 2: {axis} of the target after 100 steps"] for axis in "xyz"]
    errors = [r[f"simulation 2: error of {axis} after 100 steps, EKF"] for axis in "xyz"]
    b1 = [c for c in r.starting("B1") if c.holds is not None]
    variables = []
    for i, variable in enumerate(("x", "y", "z", "Vx", "Vy", "Vz")):
        claims = rows_of((variable,))
        variables.append(
            Row(f"table 4.3 and figure 4.{i + 1}, {variable}", where,
                f"{verdict(*claims)}: EKF {number(claims[0].ours)}, modified {number(claims[1].ours)} against "
                f"{number(claims[0].paper or 0.0)}, {number(claims[1].paper or 0.0)}", command)
        )  # fmt: skip
    return rendered([
        Row("figure 2.1, equations 2.1 to 2.6, coordinates", "assoc/sensors/", f"{HOLDS}; equation 2.2 prints x / y",
            sensors),
        Row("equations 2.7 to 2.13, derivatives", UNIT_RATES, HOLDS, model),
        Row("tables 2.1 and 2.2, equations 2.14 and 2.15, Kalman filter and EKF", "assoc/filters/kalman.py",
            f"{HOLDS}; the covariance of table 2.2 is A P A', not A P + P A'", filters),
        Row("equations 2.16 to 2.24, debiased measurements", "assoc/filters/kernels/gaussian.py",
            f"{HOLDS} against a million samples, corrected: equation 2.17 row 3, equation 2.19, sigma_theta^4 in R_c",
            modified),
        Row("equations 2.25 and 2.26, h and H", "assoc/sensors/", f"{HOLDS}; H21 is -y / (x^2 + y^2)", sensors),
        Row("equation 2.27, J", "assoc/filters/kernels/gaussian.py", f"{HOLDS}, corrected in J12 and J23", modified),
        Row("equations 2.28 and 2.29, R_p", "assoc/filters/modified_ekf.py", f"{HOLDS}; the last entry is sigma_phi^2",
            modified),
        Row("equations 2.30 to 2.32, table 2.3, mean and correction", "assoc/filters/modified_ekf.py",
            f"{HOLDS}; equation 2.32 lacks 1/2 and the tildes", modified),
        Row("figures 3.1 to 3.3, courses of the work", "assoc/filters/modified_ekf.py", HOLDS, modified),
        Row("equations 4.1 to 4.12, the model", UNIT_RATES,
            f"{HOLDS}; equation 4.4 prints a term twice", model),
        Row("equations 4.13 to 4.15, forward difference and noise", UNIT_RATES, HOLDS, model),
        Row("section 4.2, Jacobian A", UNIT_RATES,
            f"{HOLDS} with dt: the rows of the velocities print dt^2", model),
        Row("tables 4.1 and 4.2, start and parameters", where,
            f"{NOT} together: R_k and the sigmas contradict each other, so each reading is a row", command),
        *variables,
        Row("figure 4.7, errors", where, f"{NOT}: velocities keep the error of the start, no measurement reaches them",
            command),
        Row("table 4.3, modified below EKF", where,
            f"{NOT} with the paper's model: ratio {number(ratio['sigmas'].ours)} (sigmas), {number(ratio['R_k'].ours)} "
            f"(R_k) against {number(ratio['sigmas'].paper or 0.0, 2)}. If the EKF alone is given R_k: "
            f"{number(ratio['mixed'].ours)}", command),
        Row("abstract, errors of 0.77 to 1.15 %", where,
            f"{verdict(small, large)}: they are RMSE x 100 in metres, and table 4.3 has {number(small.ours)} and "
            f"{number(large.ours)}", command),
        Row("simulation 2, figure 4.8, end of the target", where,
            f"{verdict(*ends)}: within two standard deviations of what the model can reach", command),
        Row("simulation 2, figure 4.9, EKF", where, f"{verdict(*errors)}: x, y, z measured with R_k", command),
        Row("simulation 2, figure 4.10, modified EKF", "", f"{ABSENT}: where x, y and z are measured "
            "nothing is to be modified; its start has z = 10, table 4.1 z = 5", command),
        Row("conclusion 1, the model", UNIT_RATES, HOLDS, model),
        Row("conclusion 2, the modified EKF is better", "experiments/papers/modified_ekf/__main__.py",
            f"{NOT} in the paper's setting; on B1, chosen by us: {verdict(*b1)}", command),
        Row("conclusion 3, time of computation", "", f"{ABSENT}: of a machine that is not described", ""),
    ])  # fmt: skip


def fuzzy_ekf() -> str:
    """The fuzzy-adaptive EKF."""
    r, command = Results("papers.fuzzy_ekf"), run("papers.fuzzy_ekf")
    filters, fuzzy, sensors = (test(f"tests/{one}") for one in
                               ("filters/test_gaussian_filters.py", "filters/test_fuzzy.py", "sensors/"))  # fmt: skip
    where, figures = "experiments/papers/fuzzy_ekf/__main__.py", "experiments/papers/fuzzy_ekf/figures.py"
    scenarios = "CDEFGH"

    def span(claims: list[Claim], digits: int = 3) -> str:
        values = [claim.ours for claim in claims]
        return f"{number(min(values), digits)} to {number(max(values), digits)}"

    raw = [r[f"{s}: RMSE, raw measurements"] for s in scenarios]
    plain = [r.starting(f"{s}: RMSE, best fixed EKF of constant acceleration")[0] for s in scenarios]
    rules = [r[f"{s}: RMSE, the paper's rules, tuned sets"] for s in scenarios]
    literal = [r[f"{s}: RMSE, Q_0, R_0 and P_0 taken literally, EKF"] for s in scenarios]
    gained = [r[f"{s}: best fixed EKF of constant acceleration, below the raw measurements"] for s in scenarios]
    below = [r[f"{s}: the paper's rules, tuned sets, below the raw measurements"] for s in scenarios]
    against = [r[f"{s}: the paper's rules, tuned sets / best fixed EKF of constant acceleration"] for s in scenarios]
    return rendered([
        Row("figure 1, course of the estimator", "assoc/filters/fuzzy/filter.py", HOLDS, fuzzy),
        Row("equations 1 to 5, model of constant acceleration", "assoc/filters/motion/models.py",
            f"{HOLDS}; rows 5 and 8 of F are wrong in print", filters),
        Row("equations 6 and 7, H and R of positions", "assoc/filters/measurement.py", f"{HOLDS}; H is `3 x 9`",
            filters),
        Row("figure 2, equations 8 to 12, radar", "assoc/sensors/", HOLDS, sensors),
        Row("equations 13 to 31, EKF", "assoc/filters/kalman.py", f"{HOLDS}; equation 22 needs G Q G'", filters),
        Row("equations 32 to 36, scaling by q and r", "assoc/filters/fuzzy/filter.py", HOLDS, fuzzy),
        Row("rules 1 to 4, Mamdani, centroid", "assoc/filters/fuzzy/inference.py", HOLDS, fuzzy),
        Row("figures 7 to 9, membership sets", figures,
            f"{ABSENT}: the text has no numbers; ours, tuned on random flights, are drawn", command),
        Row("equation 37, RMSE", "experiments/common/command.py", HOLDS, command),
        Row("figures 3 and 4, flight and measurements, RMSE 89.65 m (km taken as its unit)", figures,
            f"{ABSENT}: its flight is not given; ours have the same raw RMSE ({span(raw)} m) and are drawn", command),
        Row("equations 38 to 40, Q_0, R_0, P_0", "experiments/papers/fuzzy_ekf/published.py",
            f"{NOT} taken literally: {span(literal)} m, worse than the raw measurements", command),
        Row("equation 41, Jacobian", "assoc/sensors/", f"{HOLDS}; row 3 lacks a square root", sensors),
        Row("figures 5 and 6, EKF, RMSE 52.06 m", figures,
            f"{NOT} on our flights: {span(plain)} m, the best of a grid", command),
        Row("EKF 41.93 % below the raw measurements", where, f"{NOT} on our flights: {span(gained)} %", command),
        Row("figures 10 and 11, EKF with inference, RMSE 35.9 m", figures,
            f"{NOT} on our flights: {span(rules)} m", command),
        Row("59.97 % below the raw measurements", where, f"{verdict(*below)}: ours {span(below)} %", command),
        Row("conclusion: inference improves the EKF", where,
            f"{verdict(*against)} scenarios: {span(against)} times the best fixed EKF of the same model, against 0.69",
            command),
        Row("figures 12 and 13, q and r over time", figures, f"{HOLDS}: drawn; no numbers to compare", command),
    ])  # fmt: skip


def dubins_enkf() -> str:
    """Dubins paths and the ensemble Kalman filter."""
    r, command = Results("papers.dubins_enkf"), run("papers.dubins_enkf")
    motion, enkf, dubins = (test(f"tests/{one}") for one in
                            ("filters/test_mixing_and_smoothing.py", "filters/test_gaussian_filters.py",
                             "simulation/test_dubins.py"))  # fmt: skip
    paths, where = "experiments/papers/dubins_enkf/flight_paths.py", "experiments/papers/dubins_enkf/ensemble.py"
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
    speeds = [c for c in r.claims if "speed of all runs" in c.quantity]
    lengths = {word: number(r[f"without obstacle: length of {word}"].ours, 4) for word in ("RSR", "LSR", "RSL", "LSL")}

    def beside(claims: list[Claim]) -> str:
        return ", ".join(f"{number(c.ours)} ({number(c.paper or 0.0)})" for c in claims)

    return rendered([
        Row("equations 1 and 2, dynamics and forces", "assoc/filters/motion/unmanned_aircraft.py",
            f"{HOLDS}; the constants are not given, those of a published aircraft are used", motion),
        Row("equation 3, ends", "", f"{ABSENT}: values are not given", ""),
        Row("equation 4, limits", where,
            f"{ABSENT}: the paper gives no values; with those of the published aircraft, speeds: {verdict(*speeds)}",
            command),
        Row("equations 5 and 6, circles, tangents, length", "assoc/simulation/dubins/paths.py", HOLDS, dubins),
        Row("equation 7, existence", "assoc/simulation/dubins/paths.py", HOLDS, dubins),
        Row("equations 8 to 13, ensemble Kalman filter", "assoc/filters/ensemble.py", HOLDS, enkf),
        Row("equations 14 to 16, length of RSL and the others", "assoc/simulation/dubins/paths.py",
            f"{HOLDS}; equation 16 is not legible. The paper prints no length; ours in m: "
            + ", ".join(f"{word} {value}" for word, value in lengths.items()), command),
        Row("figure 1, path around an obstacle", paths, f"{HOLDS}: drawn, with its kinks", command),
        Row("equations 17 to 19, forward difference", "assoc/filters/motion/unmanned_aircraft.py",
            f"{HOLDS}; the row of v adds gamma_k where v_k is meant", motion),
        Row("equations 20 to 31, filter on the model", "assoc/filters/ensemble.py", HOLDS, enkf),
        Row("figure 2, RSR is shortest", paths, verdict(best), command),
        Row("figure 3, start and end of the path with an obstacle", paths,
            f"{verdict(*points)}: as tangent points of another RSL path", command),
        Row("figure 3, SRS path", paths,
            f"{verdict(*srs)}: it turns at the obstacle's 30 m and has kinks of "
            f"{' and '.join(number(c.ours, 2) for c in srs[1:])} deg; {number(flown.ours, 4)} m can be flown", command),
        Row("conclusion: paths are optimal", paths, f"{verdict(best, *srs)}: figure 3 cannot be flown", command),
        Row("figure 4 and RMS, fixed attack, N = 300", where,
            f"{verdict(*fixed)}, and built in: ours (paper's) {beside(fixed)}, process noise chosen as the "
            "paper's errors", command),
        Row("the same, a third of the process noise", where, f"{verdict(*third)}: {beside(third)}", command),
        Row("the same, three times the process noise", where, f"{verdict(*treble)}: {beside(treble)}", command),
        Row("figure 4 (the second) and RMS, changing attack, N = 100", where,
            f"{verdict(*other)}: {beside(other)}; the course of the attack and the noise are chosen by us", command),
        Row("best with 300 members, fixed attack", where,
            f"{verdict(*members['fixed attack'])}: N 300 / N 100 {number(members['fixed attack'][0].ours)}", command),
        Row("best with 200 members, changing attack", where,
            f"{verdict(*members['changing attack'])}: N 200 / N 100 {number(members['changing attack'][0].ours)}; "
            "the text itself uses 100", command),
        Row("far better if all states are measured", where, verdict(*measured), command),
        Row("conclusion: estimates near the truth", where,
            f"{verdict(*fixed, *third, *treble)} over three process noises: the noise decides it", command),
    ])  # fmt: skip


TABLES = {
    "papers-ant-colony": ant_colony,
    "papers-clustering-time-window": clustering_time_window,
    "papers-modified-ekf": modified_ekf,
    "papers-fuzzy-ekf": fuzzy_ekf,
    "papers-dubins-enkf": dubins_enkf,
}
