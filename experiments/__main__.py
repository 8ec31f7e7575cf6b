"""List of the experiments: ``python -m experiments``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import NamedTuple


class Experiment(NamedTuple):
    """One program below ``experiments``.

    Attributes
    ----------
    name : str
        What follows ``python -m experiments.``.
    measures : str
        What it does, in one line.
    regenerates : str
        Pages, pictures and files whose figures it gives.
    """

    name: str
    measures: str
    regenerates: str


def _published(page: str, name: str) -> str:
    """What an experiment with trackers gives."""
    return f"docs/{page}.md (measured); with --publish experiments/results/trackers.{name}.json"


EXPERIMENTS = (
    Experiment(
        "benchmarks",
        "our solvers and other people's on eight families of problems",
        "docs/benchmarks.csv, docs/benchmarks.md, the tables of README.md",
    ),
    Experiment(
        "benchmarks.scale",
        "time and memory of one large scan, in a process of its own",
        "one line of JSON: family scale of the benchmarks",
    ),
    Experiment(
        "sdlib",
        "the benchmark set: makes, solves and proves its instances, checks them, runs any solver on them",
        "docs/benchmark_set.md (tables), experiments/sdlib/best.json with solutions and proofs",
    ),
    Experiment(
        "sdlib.verify",
        "one file without dependencies: is a solution feasible, and what does it cost, exactly",
        "nothing: judges the rows of experiments/sdlib/best.json",
    ),
    Experiment(
        "benchmarks.wide_gaps",
        "seeds of ghosts whose linear program is far below the optimum",
        "the seeds of family wide gap in experiments/benchmarks/families.py",
    ),
    Experiment(
        "pages",
        "nothing: writes the tables of thirteen pages from the result files",
        "docs/papers.md, docs/filters.md, docs/recordings.md, docs/start.md, docs/dependencies.md, docs/sweeps.md, "
        "docs/solvers.md, docs/which_solver.md, docs/ant_colony.md, docs/concepts.md, docs/tracking.md, "
        "docs/registration.md, docs/stonesoup.md",
    ),
    Experiment(
        "papers.ant_colony",
        "table 1 of the ant colony paper, readings of it, its conclusion",
        "docs/sweeps.md (table 1), docs/papers.md; with --publish experiments/results/papers.ant_colony.json",
    ),
    Experiment(
        "papers.clustering_time_window",
        "the clustering time window of Cahyono's thesis on simulated recordings",
        "docs/recordings.md (what the window is worth), docs/papers.md; with --publish "
        "experiments/results/papers.clustering_time_window.json",
    ),
    Experiment(
        "papers.clustering_time_window.tables",
        "the thesis's tables 2.1 and 4.1 to 4.24, given as a folder, and its five aircraft",
        "docs/recordings.md, docs/papers.md; with --publish "
        "experiments/results/papers.clustering_time_window.tables.json",
    ),
    Experiment(
        "papers.modified_ekf",
        "the modified EKF for a 3-D radar: the paper's setting, and B1",
        "docs/filters.md, docs/papers.md; with --publish experiments/results/papers.modified_ekf.json",
    ),
    Experiment(
        "papers.fuzzy_ekf",
        "the EKF with fuzzy inference",
        "docs/filters.md, docs/papers.md; with --publish experiments/results/papers.fuzzy_ekf.json",
    ),
    Experiment(
        "papers.fuzzy_ekf.tune_published",
        "tuning of what the fuzzy paper does not give",
        "experiments/papers/fuzzy_ekf/published_rules.json",
    ),
    Experiment(
        "papers.dubins_enkf",
        "Dubins paths and the ensemble Kalman filter",
        "docs/filters.md, docs/papers.md; with --publish experiments/results/papers.dubins_enkf.json",
    ),
    Experiment(
        "filters.benchmark",
        "time of our filters and of other packages'",
        "docs/filters.md (speed); with --publish experiments/results/filters.benchmark.json",
    ),
    Experiment(
        "filters.consistency",
        "NEES and NIS of every filter",
        "docs/filters.md (consistency); with --publish experiments/results/filters.consistency.json",
    ),
    Experiment(
        "filters.endurance",
        "covariances after 100,000 corrections",
        "docs/filters.md (consistency); with --publish experiments/results/filters.endurance.json",
    ),
    Experiment("filters.tune", "tuning of the fuzzy rules and of the IMM", "assoc/filters/fuzzy/tuned_parameters.json"),
    Experiment("trackers.asynchronous", "turning radars, late plots", _published("tracking", "asynchronous")),
    Experiment("trackers.bearings", "bearings alone: tracks among ghosts", _published("tracking", "bearings")),
    Experiment("trackers.benchmark", "our trackers and Stone Soup's", _published("tracking", "benchmark")),
    Experiment("trackers.biases", "registration of biased radars", _published("registration", "biases")),
    Experiment("trackers.capacity", "many targets, long runs", _published("tracking", "capacity")),
    Experiment("trackers.close_targets", "trackers where association is hard", _published("tracking", "close_targets")),
    Experiment("trackers.live", "plots as they come: the time of a step", _published("tracking", "live")),
    Experiment(
        "trackers.warm_starts",
        "whether trackers would gain by warm starts",
        "docs/tracking.md (warm starts); with --publish experiments/results/trackers.warm_starts.json",
    ),
    Experiment("trackers.comparison", "our trackers side by side", _published("tracking", "comparison")),
    Experiment(
        "trackers.fusion_in_stone_soup",
        "fusion before tracking, in Stone Soup",
        "docs/stonesoup.md; with --publish experiments/results/trackers.fusion_in_stone_soup.json",
    ),
    Experiment(
        "metaheuristics.ablation",
        "aco, genetic and tabu with each part taken out, and with two workers",
        "docs/solvers.md (what each part contributes); with --publish experiments/results/metaheuristics.ablation.json",
    ),
    Experiment(
        "metaheuristics.against_peers",
        "aco, genetic and tabu after seconds, other programs after a minute, on ghosts",
        "a table on the terminal; with --publish a file beside the other results",
    ),
    Experiment(
        "metaheuristics.sweep",
        "alpha, beta, rho, ants and refinement of the ant colony on problems that are not easy",
        "docs/ant_colony.md and its figures; with --publish experiments/results/metaheuristics.sweep.json",
    ),
    Experiment(
        "ambiguous_bearings",
        "certified optima of bearings with two costs",
        "docs/concepts.md (prior); with --publish experiments/results/ambiguous_bearings.json",
    ),
    Experiment(
        "sweep_overhead",
        "time of a parameter study besides its solves",
        "docs/sweeps.md (overhead); with --publish experiments/results/sweep_overhead.json",
    ),
    Experiment(
        "cold_start",
        "what a user waits for after an installation: make bench-cold",
        "docs/start.md (first-call), once published with --publish",
    ),
    Experiment(
        "scan_time",
        "one scan from its measurements to a proven answer, part by part",
        "docs/which_solver.md (a scan); with --publish experiments/results/scan_time.json",
    ),
    Experiment(
        "linear_programs",
        "linear programs of our simplex method and of HiGHS",
        "docs/solvers.md (dual bound); with --publish experiments/results/linear_programs.json",
    ),
    Experiment(
        "ghost_rankings",
        "the ten best of ghost scenes, with proof",
        "docs/which_solver.md (rankings); with --publish experiments/results/ghost_rankings.json",
    ),
    Experiment("long_runs", "memory and time of runs that last for days", "docs/reliability.md (long runs)"),
    Experiment("gallery", "the pictures of the documentation", "docs/images"),
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the list; returns the exit code."""
    argparse.ArgumentParser(
        prog="python -m experiments",
        description="List the experiments. Each has its own program, python -m experiments.NAME, with --help.",
    ).parse_args(arguments)
    print("python -m experiments.NAME [--help]\n")
    for name, measures, regenerates in EXPERIMENTS:
        print(f"{name}\n    {measures}\n    -> {regenerates}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
