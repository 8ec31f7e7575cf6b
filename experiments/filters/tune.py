"""Tune the fuzzy rules and the IMM in the same way; writes assoc/filters/fuzzy/tuned_parameters.json.

Both see the same random flights and the same measurements, and have the same search: adaptation of a covariance matrix
(CMA-ES, package `cma`), as many evaluations, the same first spread, starting from the package's parameters. None
of these flights is in the report (experiments/papers/fuzzy_ekf.py). At the end both are measured on as many others,
which shows whether they are overfitted. About three minutes of one core.
"""

import argparse
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from assoc._files.output import write_text
from assoc._types import Array
from assoc.errors import AssocError
from assoc.filters import tuned_data
from assoc.filters.base import Filter
from experiments.common.command import whole
from experiments.filters.kinds import fuzzy_filter, imm
from experiments.filters.manoeuvres import Batch, errors, random_flights

OUTPUT = Path(__file__).resolve().parents[2] / "assoc" / "filters" / "fuzzy" / "tuned_parameters.json"
SPREAD = 0.2
"""First standard deviation of the search in each coordinate, most of which are logarithms."""


def to_steps(centres: Array, positive: bool) -> Array:
    """Increasing centres as free numbers: logarithms of their steps, from 0 if they are positive."""
    if positive:
        return np.log(np.diff(np.concatenate([[0.0], centres])))
    return np.concatenate([centres[:1], np.log(np.diff(centres))])


def from_steps(x: Array, positive: bool) -> list[float]:
    """Return the centres that `to_steps` had; whatever x is, they increase."""
    first = np.exp(x[:1]) if positive else x[:1]
    centres: list[float] = np.cumsum(np.concatenate([first, np.exp(x[1:])])).tolist()
    return centres


def fuzzy_vector(data: dict[str, Any]) -> Array:
    """Free vector of parameters of the fuzzy filter: centres of the inputs, of log10 q and of calm."""
    inputs = [to_steps(np.array(rules["inputs"]), True) for rules in (data, *data["others"])]
    outputs = [to_steps(np.array(centres), False) for centres in (*data["outputs"], data["calm"])]
    return np.concatenate([*inputs, *outputs])


def fuzzy_data(x: Array, like: dict[str, Any]) -> dict[str, Any]:
    """Parameters of the fuzzy filter from a free vector; all else is `like`."""
    count = len(like["inputs"])
    parts = list(x.reshape(-1, count))
    alarms = 1 + len(like["others"])
    inputs = [from_steps(steps, True) for steps in parts[:alarms]]
    outputs = [from_steps(steps, False) for steps in parts[alarms:]]
    others = [{**rules, "inputs": centres} for rules, centres in zip(like["others"], inputs[1:], strict=True)]
    return {**like, "inputs": inputs[0], "others": others, "outputs": outputs[:-1], "calm": outputs[-1]}


NOISES = ("straight_noise", "rate_spread", "turn_noise", "rate_noise")
STAYS = ("stay_straight", "stay_turning")
LEAST = 1e-4
"""A noise below this is none, and its logarithm would lead the search astray."""


def imm_vector(data: dict[str, float]) -> Array:
    """Free vector of parameters of the IMM: logarithms of noises, logits of probabilities."""
    noises = np.log([max(data[name], LEAST) for name in NOISES])
    stays = np.array([data[name] for name in STAYS])
    return np.concatenate([noises, np.log(stays / (1 - stays))])


def imm_data(x: Array) -> dict[str, float]:
    """Parameters of the IMM from a free vector."""
    noises = dict(zip(NOISES, np.exp(x[:4]).tolist(), strict=True))
    return {**noises, **dict(zip(STAYS, (1 / (1 + np.exp(-x[4:]))).tolist(), strict=True))}


def score(make: Callable[[], Filter[Any]], batch: Batch) -> float:
    """Mean over the flights of the logarithm of the RMSE, so that gentle and hard flights weigh alike."""
    try:
        squared = errors(make(), batch).mean(axis=0)
    except AssocError:
        # centres so far apart that nothing is left of them, or covariances that overflow
        return 1e3
    return float(0.5 * np.log(squared).mean())


def search(name: str, objective: Callable[[Array], float], start: Array, evaluations: int, seed: int) -> Array:
    """Search for the least value; the best vector, never worse than the start."""
    try:
        import cma
    except ImportError as error:
        raise SystemExit("the search needs cma: pip install assoc[bench]") from error
    begun = objective(start)
    # the budget alone ends it, so that it is the same for both; seed 0 would mean the clock
    state = cma.CMAEvolutionStrategy(start, SPREAD, {"seed": seed + 1, "verbose": -9})
    while state.countevals < evaluations:
        asked = state.ask()
        state.tell(asked, [objective(x) for x in asked])
        if state.countiter % 5 == 0:
            print(f"{name}: {state.countevals} evaluations, {np.exp(state.best.f):.3f} m", flush=True)
    # the mean of the distribution has seen more noise averaged than its best sample
    candidates = [(begun, start), (state.best.f, state.best.x), (objective(state.mean), state.mean)]
    value, best = min(candidates, key=lambda pair: pair[0])
    print(f"{name}: {np.exp(begun):.3f} m at the start, {np.exp(value):.3f} m after {state.countevals} evaluations")
    return best


def parsed(
    name: str, about: str, arguments: list[str] | None, *, evaluations: int, flights: int, seed: int, output: Path
) -> argparse.Namespace:
    """Options of a program that tunes on random flights, with these defaults."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{name}", description=about)
    add = partial(parser.add_argument, metavar="N")
    text = f"evaluations of each search (default {evaluations})"
    add("--evaluations", type=whole(1), default=evaluations, help=text)
    add("--flights", type=whole(1), default=flights, help=f"number of random flights (default {flights})")
    add("--seed", type=whole(0), default=seed, help=f"seed of flights, noise and search (default {seed})")
    parser.add_argument("--output", type=Path, default=output, metavar="FILE", help="the file to write")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Tune and write; returns the exit code."""
    about = "Tune the fuzzy rules and the IMM on random flights; by default into the package's own file."
    chosen = parsed("filters.tune", about, arguments, evaluations=500, flights=120, seed=20_000, output=OUTPUT)
    rng = np.random.default_rng(chosen.seed)
    batch = Batch.draw(random_flights(chosen.flights, rng), 1, rng)
    others = Batch.draw(random_flights(chosen.flights, rng), 1, rng)

    data = tuned_data()
    like = {key: value for key, value in data.items() if key not in ("about", "imm")}
    rules = search(
        "fuzzy", lambda x: score(lambda: fuzzy_filter(fuzzy_data(x, like)), batch), fuzzy_vector(like),
        chosen.evaluations, chosen.seed,
    )  # fmt: skip
    mixed = search(
        "IMM", lambda x: score(lambda: imm(imm_data(x)), batch), imm_vector(data["imm"]),
        chosen.evaluations, chosen.seed,
    )  # fmt: skip
    made = {"fuzzy": lambda: fuzzy_filter(fuzzy_data(rules, like)), "IMM": lambda: imm(imm_data(mixed))}
    told = []
    for name, make in made.items():
        told.append(f"{name} {np.exp(score(make, batch)):.2f} m, on as many others {np.exp(score(make, others)):.2f} m")
        print(told[-1])
    about = (
        f"tuned by experiments/filters/tune.py --seed {chosen.seed} on {chosen.flights} random flights, "
        f"{chosen.evaluations} evaluations each: {'; '.join(told)}"
    )
    text = json.dumps({"about": about, **fuzzy_data(rules, like), "imm": imm_data(mixed)}, indent=2)
    write_text(chosen.output, text + "\n")
    print(f"{chosen.output}: written")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
