"""Tune the sets and the base noise of the paper's filter, which the paper does not give, on random flights.

CMA-ES as for the tuned rules and the IMM (experiments/filters/tune.py), on other flights than those of the report.
Without it the comparison would be between tuned filters and one whose parameters were chosen by eye. Writes
experiments/papers/fuzzy_ekf/published_rules.json.
"""

import datetime
import json

import numpy as np

from assoc._files.output import write_text
from experiments.filters.manoeuvres import Batch, random_flights
from experiments.filters.tune import parsed, score, search
from experiments.papers.fuzzy_ekf.published import FIRST_GUESS, TUNED, from_vector, published_filter, vector


def main(arguments: list[str] | None = None) -> int:
    """Tune and write; returns the exit code."""
    about = "Tune the sets and the base noise of the paper's fuzzy filter on random flights."
    name = "papers.fuzzy_ekf.tune_published"
    chosen = parsed(name, about, arguments, evaluations=450, flights=50, seed=30_000, output=TUNED)
    rng = np.random.default_rng(chosen.seed)
    batch, others = (Batch.draw(random_flights(chosen.flights, rng), 1, rng) for _ in range(2))
    begun = float(np.exp(score(lambda: published_filter(FIRST_GUESS), batch)))
    best = search(
        "published rules", lambda x: score(lambda: published_filter(from_vector(x)), batch), vector(FIRST_GUESS),
        chosen.evaluations, chosen.seed,
    )  # fmt: skip
    data = from_vector(best)
    ends = [float(np.exp(score(lambda: published_filter(data), flights))) for flights in (batch, others)]
    about = (
        f"{chosen.evaluations} evaluations on {chosen.flights} random flights: {begun:.1f} m at the start, "
        f"{ends[0]:.1f} m at the end, {ends[1]:.1f} m on as many other flights"
    )
    head = {"about": about, "seed": chosen.seed, "date": datetime.date.today().isoformat()}
    write_text(chosen.output, json.dumps({**head, **data}, indent=2) + "\n")
    print(f"{about}\n{chosen.output}: written")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
