"""The command line that most experiments share: --quick, --seed, --json, --figure."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from assoc._files.output import write_atomically
from assoc._types import Array
from experiments.common.claims import Claim, print_table, save_json

Experiment = Callable[[bool, np.random.Generator], tuple[list[Claim], Any]]
Draw = Callable[[Any, Any], None]


def main(
    name: str,
    title: str,
    experiment: Experiment,
    draw: Draw,
    size: tuple[float, float],
    arguments: Sequence[str] | None = None,
) -> int:
    """Run an experiment: print its claims, save its figure and, if asked, its JSON.

    Parameters
    ----------
    name : str
        Of the experiment's module below ``experiments``; its last part names the figure unless --figure does.
    title : str
        Of the table.
    experiment : callable (quick, rng) -> (claims, what the figure shows)
    draw : callable (figure, what it shows)
    size : (float, float)
        Of the figure, inches.
    """
    parser = make_parser(name, title)
    return run(parser, parser.parse_args(arguments), name, title, experiment, draw, size)


def make_parser(name: str, title: str) -> argparse.ArgumentParser:
    """Return the parser of the options that the experiments share; an experiment may add its own."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{name}", description=f"{title}.")
    parser.add_argument("--quick", action="store_true", help="fewer or shorter runs, for a first look")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of all random numbers (default 0)")
    parser.add_argument("--json", metavar="FILE", help="write the results here")
    parser.add_argument("--figure", metavar="FILE", help=f"write the figure here (default {_picture(name)})")
    return parser


def run(
    parser: argparse.ArgumentParser,
    chosen: argparse.Namespace,
    name: str,
    title: str,
    experiment: Experiment,
    draw: Draw,
    size: tuple[float, float],
) -> int:
    """Run an experiment with the options chosen; see `main`."""
    if chosen.seed < 0:
        parser.error("--seed must be at least 0")
    claims, shown = experiment(chosen.quick, np.random.default_rng(chosen.seed))
    print_table(claims, title)
    if chosen.json:
        save_json(chosen.json, claims, name, chosen.seed)
    figure_file = Path(chosen.figure or _picture(name))
    save_figure(figure_file, draw, shown, size)
    print(f"{figure_file}: written")
    return 0


def _picture(name: str) -> str:
    return f"{name.rpartition('.')[2]}.png"


def save_figure(path: Path, draw: Draw, shown: Any, size: tuple[float, float]) -> None:
    """Draw without a display and write a PNG."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise SystemExit("the figure needs matplotlib: pip install assoc[plot]") from error
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure, shown)
    write_atomically(path, lambda file: figure.savefig(file, format=path.suffix[1:] or "png", dpi=130))


def mean_interval(values: Array) -> tuple[float, float]:
    """95 % interval of a mean over independent runs (n,)."""
    half = 1.96 * float(np.std(values, ddof=1)) / len(values) ** 0.5
    middle = float(np.mean(values))
    return middle - half, middle + half


def rmse(squared: Array) -> float:
    """Root of the mean of squared errors."""
    return float(np.sqrt(np.mean(squared)))


def rmse_interval(squared: Array) -> tuple[float, float]:
    """95 % interval of an RMSE; squared errors (K, runs)."""
    low, high = mean_interval(squared.mean(axis=0))
    return max(low, 0.0) ** 0.5, high**0.5
