"""The paper's rules against one fixed EKF that was tuned once, on the flights on which the rules were tuned.

    python -m experiments.papers.fuzzy_ekf.tuned_once [--quick] [--seed N] [--json FILE] [--publish]

papers.fuzzy_ekf compares with the best fixed EKF of each scenario, chosen in hindsight. A user has one noise for all:
here the EKF of constant acceleration whose noise is best on the 50 random flights of tune_published. Full size: 100
runs of each scenario.
"""

from functools import partial

import numpy as np

from assoc.filters import ConstantAcceleration, ExtendedKalmanFilter
from experiments.common.claims import Claim
from experiments.common.command import main, rmse
from experiments.filters.b1 import ratio_interval
from experiments.filters.manoeuvres import NEW_SCENARIOS, SCENARIOS, Batch, errors, random_flights
from experiments.filters.tune import score
from experiments.papers.fuzzy_ekf import published

NOISES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Choose the noise, then compare on C to H; --quick has fewer runs."""
    flights = np.random.default_rng(published.tuned()["seed"])
    batch = Batch.draw(random_flights(50, flights), 1, flights)
    noise = min(NOISES, key=lambda one: score(lambda: ExtendedKalmanFilter(ConstantAcceleration(one)), batch))
    claims = [Claim("noise of the fixed EKF", "m/s^2", None, noise, source="chosen by us on random flights")]
    for name, flight in {**SCENARIOS, **NEW_SCENARIOS}.items():
        batch = Batch.draw([flight], 20 if quick else 100, rng)
        rules = errors(published.published_filter(published.tuned()), batch)
        fixed = errors(ExtendedKalmanFilter(ConstantAcceleration(noise)), batch)
        what = f"{name}: the paper's rules, tuned sets / EKF of constant acceleration tuned once"
        claims.append(Claim(what, "", 0.69, rmse(rules) / rmse(fixed), ratio_interval(rules, fixed, rng), (None, 1.0),
                            source="ratio of the RMSE in section III; at most 1 chosen by us"))  # fmt: skip
    return claims


program = partial(main, "papers.fuzzy_ekf.tuned_once", experiment, __doc__)


if __name__ == "__main__":
    raise SystemExit(program())
