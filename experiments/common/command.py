"""The command line that most experiments share: --quick, --seed, --json, --figure, --publish."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtrit

from assoc._files.output import write_atomically
from assoc._types import Array
from experiments.common.claims import Claim, load_json, save_json
from experiments.common.results import print_claims, result_file

Experiment = Callable[..., Any]
"""From whether it is to be quick and a random generator, or from all options if it has some of its own, to its claims;
with a figure, to these and what the figure shows."""
Draw = Callable[[Any, Any], None]
Figure = tuple[Draw, tuple[float, float]]
"""What draws it, and its size in inches."""


def main(
    name: str,
    experiment: Experiment,
    about: str,
    arguments: Sequence[str] | None = None,
    *,
    figure: Figure | None = None,
    only: Iterable[str] = (),
    seeds: tuple[Any, ...] = (),
    options: Sequence[Callable[[argparse.ArgumentParser], object]] = (),
    said: str = "",
    **defaults: Any,
) -> int:
    """Run ``python -m experiments.NAME``: print its claims, write what is asked; `about` describes it.

    only: Names of its parts, of which --only chooses some: `names` of the options.
    seeds: How many scenes there are if --seeds does not say it, of what, and how many at the least (2).
    options: What adds options of its own.
    said: What a result file says of these, with their names in braces.
    defaults: Of options that all experiments have.
    """
    parser, names = make_parser(name, about, figure), [*only]
    if names:
        add_only(parser, names)
    if seeds:
        add_seeds(parser, *seeds)
    for add in options:
        add(parser)
    parser.set_defaults(**defaults)
    chosen = parser.parse_args(arguments)
    chosen.names = getattr(chosen, "only", None) or names
    call = (lambda *_: experiment(chosen)) if names or seeds or options else experiment
    return run(parser, chosen, call, about + said.format(**vars(chosen)), figure)


def make_parser(name: str, about: str, figure: Figure | None = None) -> argparse.ArgumentParser:
    """Return the parser of the options that the experiments share; an experiment may add its own."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{name}", description=about.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="fewer or shorter runs, for a first look")
    text = "seed of all random numbers (default %(default)s)"
    parser.add_argument("--seed", type=whole(0), default=0, metavar="N", help=text)
    if figure is not None:
        parser.add_argument("--figure", metavar="FILE", help="draw the figure, a PNG, and write it here")
    add_files(parser, name)
    return parser


def whole(least: int) -> Callable[[str], int]:
    """Return what reads an option that is a whole number, at least so large."""

    def number(text: str) -> int:
        if int(text) < least:
            raise argparse.ArgumentTypeError(f"expected at least {least}, got {text}")
        return int(text)

    return number


def above_zero(text: str) -> float:
    """Read an option that is a number above 0, but no immense one: seconds, for example."""
    if not 0.0 < float(text) < 1e6:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got {text}")
    return float(text)


def add_seeds(parser: argparse.ArgumentParser, default: int, of: str, least: int = 2) -> None:
    """Add the option that says how many scenes or runs there are."""
    parser.add_argument("--seeds", type=whole(least), default=default, metavar="N", help=f"{of} (default {default})")


def add_files(parser: argparse.ArgumentParser, name: str) -> None:
    """Add the options that write what an experiment found: a file, and its result file."""
    parser.add_argument("--json", metavar="FILE", help="write the results here")
    parser.add_argument(
        "--publish",
        action="store_true",
        help=f"write experiments/results/{name}.json, from which the pages take their figures; never with --quick",
    )


def add_only(parser: argparse.ArgumentParser, names: Sequence[str]) -> None:
    """Add the option that runs a part of what is compared; with --publish it replaces these rows of the result file."""
    known = ", ".join(names).replace("%", "%%")
    parser.add_argument(
        "--only", nargs="+", choices=names, metavar="NAME",
        help=f"run these alone; with --publish their rows of the file are replaced: {known}",
    )  # fmt: skip


def report(chosen: argparse.Namespace, claims: list[Claim], name: str, about: str | None) -> None:
    """Print the claims of an experiment, and write the files that are asked for (`add_files`)."""
    about, seed = about or "", getattr(chosen, "seed", 0)
    # rows of long tables are not printed
    print_claims([c for c in claims if not c.quantity.startswith("setting")], about.split("\n")[0].rstrip("."))
    if chosen.json:
        save_json(chosen.json, claims, name, seed, about)
    if chosen.publish:
        path = result_file(name)
        if getattr(chosen, "only", None) and path.exists():
            claims = replaced(load_json(path), claims)
        save_json(path, claims, name, seed, about)
        print(f"{path}: written; now: python -m experiments.pages")


def replaced(claims: list[Claim], newer: list[Claim]) -> list[Claim]:
    """Claims, those of a quantity that newer ones have replaced by them; new quantities follow those before them."""
    found, index = list(claims), len(claims)
    for claim in newer:
        known = [i for i, other in enumerate(found) if other.quantity == claim.quantity]
        if known:
            index = known[0]
            found[index] = claim
        else:
            index = min(index + 1, len(found))
            found.insert(index, claim)
    return found


def run(
    parser: argparse.ArgumentParser,
    chosen: argparse.Namespace,
    experiment: Experiment,
    about: str,
    figure: Figure | None = None,
) -> int:
    """Run an experiment with the options chosen; see `main`."""
    name = parser.prog.removeprefix("python -m experiments.")
    if chosen.publish and chosen.quick:
        parser.error("--publish needs the full run, got --quick")
    found = experiment(chosen.quick, np.random.default_rng(chosen.seed))
    claims, shown = (found, None) if figure is None else found
    report(chosen, claims, name, about)
    if figure is not None and chosen.figure is not None:
        save_figure(Path(chosen.figure), figure[0], shown, figure[1])
        print(f"{chosen.figure}: written")
    return 0


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
    """95 % interval of a mean over independent runs (n,), by Student's t: runs are often few."""
    half = float(stdtrit(len(values) - 1, 0.975) * np.std(values, ddof=1)) / len(values) ** 0.5
    middle = float(np.mean(values))
    return middle - half, middle + half


def rmse(squared: Array) -> float:
    """Root of the mean of squared errors."""
    return float(np.sqrt(np.mean(squared)))


def rmse_interval(squared: Array) -> tuple[float, float]:
    """95 % interval of an RMSE; squared errors (K, runs)."""
    low, high = mean_interval(squared.mean(axis=0))
    return max(low, 0.0) ** 0.5, high**0.5
