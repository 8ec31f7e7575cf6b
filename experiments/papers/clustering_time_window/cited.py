"""Multiple hypothesis tracking with an interacting multiple model filter, which the thesis cites (Blackman 2004).

The track-oriented MHT with the window and time stamps on recordings of S1, whose aircraft turn: once with the extended
Kalman filter of constant velocity of the other experiments, once with two such models of a tenth and of all of the
noise of a manoeuvre, from one to the other as `assoc track --filter imm-cv` has it. Full size: 6 recordings of 1,130 s.
"""

from typing import Any

import numpy as np

from assoc.recordings import radar_of
from assoc.tracking.filter_choice import manoeuvre_noise, two_speeds
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.clustering_time_window import traffic
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import run


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """CT, MT and IT with each filter, and the differences; --quick has fewer and shorter recordings."""
    filters: dict[str, Any] = {"EKF": None, "IMM": two_speeds(manoeuvre_noise(traffic.ROTATION), 2)}
    found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in filters}
    for recording, groups in traffic.recordings(2 if quick else 6, rng, 300.0 if quick else traffic.DURATION):
        for name, filter_ in filters.items():
            tracker = HypothesisTracker(radar_of(recording), filter=filter_)
            rates = run(tracker, groups["window"]).rates(recording)
            found[name].append((rates.ct, rates.mt, rates.it))
    values = {name: np.array(rows) for name, rows in found.items()}
    values["IMM less EKF"] = values["IMM"] - values["EKF"]
    return [
        Claim(f"{rate}, MHT, CTW, time stamps, {name}", "%", None, float(column.mean()), mean_interval(column),
              source="section 1.1, named there")
        for name, rows in values.items() for rate, column in zip(("CT", "MT", "IT"), rows.T, strict=True)
    ]  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(main("papers.clustering_time_window.cited", experiment, __doc__))
