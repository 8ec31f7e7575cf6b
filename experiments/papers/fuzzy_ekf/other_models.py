"""The models of Singer and of jerk, which the fuzzy paper names, against its own of constant acceleration.

One EKF of each model, without rules; each is tuned once, on the 50 random flights on which the rules were tuned, over
a grid of standard deviations and correlation times. Full size: 100 runs of each scenario.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from assoc.filters import ConstantAcceleration, ExtendedKalmanFilter, Jerk, Singer
from experiments.common.claims import Claim
from experiments.common.command import main, rmse
from experiments.filters.b1 import ratio_interval
from experiments.filters.manoeuvres import EVERY_SCENARIO, Batch, Flight, errors, random_flights
from experiments.filters.tune import score
from experiments.papers.fuzzy_ekf import published
from experiments.papers.fuzzy_ekf.tuned_once import NOISES

GRIDS = {
    "Singer": [(Singer, *values) for values in product((5.0, 10.0, 20.0, 40.0), (1.0, 2.0, 5.0, 10.0, 20.0))],
    "jerk": [(Jerk, *values) for values in product((1.0, 2.0, 5.0, 10.0, 20.0), (0.5, 1.0, 2.0, 5.0, 20.0))],
}
"""Model, standard deviation (m/s^2, m/s^3), correlation time (s)."""


def experiment(
    quick: bool,
    rng: np.random.Generator,
    *,
    grids: Mapping[str, Sequence[tuple[Any, float, float]]] = GRIDS,
    scenarios: Mapping[str, Flight] = EVERY_SCENARIO,
) -> list[Claim]:
    """Tune each model, then compare on C to H; --quick has fewer runs."""
    flights = np.random.default_rng(published.tuned()["seed"])
    batch = Batch.draw(random_flights(50, flights), 1, flights)
    noise = min(NOISES, key=lambda noise: score(lambda: ExtendedKalmanFilter(ConstantAcceleration(noise)), batch))
    makers: dict[str, Callable[[], ExtendedKalmanFilter]] = {}
    claims = []
    for name, grid in grids.items():
        found = [lambda model=model: ExtendedKalmanFilter(model[0](*model[1:])) for model in grid]
        values = [score(make, batch) for make in found]
        makers[name] = found[int(np.argmin(values))]
        _, sigma, seconds = grid[int(np.argmin(values))]
        unit = "m/s^2" if name == "Singer" else "m/s^3"
        for what, value, of in (("standard deviation", sigma, unit), ("correlation time", seconds, "s")):
            claims.append(Claim(f"{name}: {what}", of, None, value, source="chosen by us on random flights"))
    for scenario, flight in scenarios.items():
        drawn = Batch.draw([flight], 20 if quick else 100, rng)
        plain = errors(ExtendedKalmanFilter(ConstantAcceleration(noise)), drawn)
        for name, make in makers.items():
            other = errors(make(), drawn)
            claims.append(
                Claim(f"{scenario}: EKF, model {name} / constant acceleration, each tuned once", "", None,
                      rmse(other) / rmse(plain), ratio_interval(other, plain, rng), source="introduction, named there")
            )  # fmt: skip
    return claims


if __name__ == "__main__":
    raise SystemExit(main("papers.fuzzy_ekf.other_models", experiment, __doc__))
