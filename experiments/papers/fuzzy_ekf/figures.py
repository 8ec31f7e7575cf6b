"""Figures 3 to 13 of the paper with ours: flight, errors, membership sets, and q and r over time."""

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantAcceleration, ExtendedKalmanFilter, FuzzyRules
from experiments.filters.b1 import converted
from experiments.filters.manoeuvres import Batch
from experiments.papers.fuzzy_ekf import published


def follow(batch: Batch) -> dict[str, Array]:
    """One run of the paper's filter and of the EKF without rules: positions (K, 3), and q and r (K,)."""
    data = published.tuned()
    filters = {
        "EKF": ExtendedKalmanFilter(ConstantAcceleration(data["noise"])),
        "rules": published.published_filter(data),
    }
    found: dict[str, Array] = {}
    for name, filter in filters.items():
        state: Any = filter.start(batch.start(9)[:1])
        places, q, r = [], [], []
        for k in range(2, len(batch.truth)):
            state = filter.update(filter.predict(state, 1.0), batch.measured[k, :1], batch.radar).state
            places.append(state.mean[0, :3])
            if name == "rules":
                alpha = (state.innovations[:, -1] ** 2).mean(axis=1)
                q.append(float(state.process_scale[0, 0]))
                r.append(float(filters["rules"].measurement(alpha)[0]))
        found[name] = np.array(places)
        if name == "rules":
            found["q"], found["r"] = np.array(q), np.array(r)
    return found


def draw_published(figure: Any, batch: Batch) -> None:
    """Draw what the paper's figures show, of one run of the first scenario."""
    found = follow(batch)
    panels = figure.subplots(2, 4)
    truth = batch.truth[2:, 0] / 1e3
    raw = converted(batch.measured[2:, 0], batch.radar.covariance)[0] / 1e3
    path, error, factors, late = panels[0, 0], panels[0, 1], panels[0, 2], panels[0, 3]
    middle = slice(35, 60)
    path.plot(*raw[middle, :2].T, "k.", markersize=4, label="measured")
    path.plot(*truth[middle, :2].T, "C2", label="truth")
    path.plot(*(found["EKF"][middle, :2] / 1e3).T, "C0", label="EKF")
    path.plot(*(found["rules"][middle, :2] / 1e3).T, "C3--", label="with inference")
    path.set(title="x, y (km), as figures 3, 5, 10", aspect="equal", adjustable="datalim")
    path.legend(fontsize=7)
    t = np.arange(2, len(batch.truth))
    for label, values, style in (
        ("measured", raw * 1e3, "k:"),
        ("EKF", found["EKF"], "C0"),
        ("with inference", found["rules"], "C3--"),
    ):
        error.plot(t, np.linalg.norm(values - truth * 1e3, axis=1), style, label=label, linewidth=1)
    error.set(title="error (m), as figures 4, 6, 11", xlabel="time (s)")
    error.legend(fontsize=7)
    for panel, name, number in ((factors, "q", 12), (late, "r", 13)):
        panel.plot(t, found[name], "C3")
        panel.set(title=f"{name}_k, as figure {number}", xlabel="time (s)")
    rules = published.published_filter(published.tuned())
    for panel, made, kind, title in (
        (panels[1, 0], rules.process[0], "input", "alpha, as figure 7"),
        (panels[1, 1], rules.process[0], "output", "q, as figure 8"),
        (panels[1, 2], rules.measurement, "output", "r, as figure 9"),
    ):
        _draw_sets(panel, made, kind)
        panel.set(title=f"{title}, tuned")
    panels[1, 3].set_axis_off()


def _draw_sets(panel: Any, rules: FuzzyRules, kind: str) -> None:
    variable = rules.input if kind == "input" else rules.output
    for name, (a, b, c, d) in variable.sets.items():
        panel.plot([a, b, c, d], [0, 1, 1, 0], label=name)
    panel.legend(fontsize=7)
