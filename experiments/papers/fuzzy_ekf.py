"""Fuzzy-adaptive EKF on manoeuvring targets, compared with the best fixed EKF and an IMM.

    python -m experiments.papers.fuzzy_ekf [--quick] [--seed N] [--json FILE] [--figure FILE]

The paper shows one trajectory without units or membership functions and reports 42 % (EKF) and 60 % (EKF with
inference) below the raw measurements. Here: scenarios C, D and E; the rules and the IMM were both tuned on random
flights that are not among them (experiments.filters.tune.py). The fixed EKFs are chosen in hindsight, for
each scenario the best of a grid: no filter fixed in advance could be better.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    Motion,
    paper_rules,
    tuned_data,
)
from experiments.common.claims import Claim
from experiments.common.command import main, rmse, rmse_interval
from experiments.filters.b1 import ratio_interval
from experiments.filters.kinds import fuzzy_filter, imm
from experiments.filters.manoeuvres import SCENARIOS, Batch, Flight, errors, smoothed_errors

LAG = 2


def fixed(turns: bool, quick: bool) -> Iterator[tuple[str, Motion]]:
    """Fixed filters: constant velocity and acceleration, or coordinated turns, over a grid of noises."""
    if turns:
        for noise in (1.0, 3.0) if quick else (0.5, 1.0, 2.0, 3.0, 5.0):
            for rate in (0.01, 0.02) if quick else (0.005, 0.01, 0.015, 0.02, 0.03):
                yield f"turn {noise:g}, {rate:g}", CoordinatedTurn(noise, rate)
        return
    for noise in (8.0, 18.0, 30.0) if quick else (4.0, 5.0, 6.0, 8.0, 12.0, 15.0, 18.0, 22.0, 26.0, 32.0):
        yield f"velocity {noise:g}", ConstantVelocity(noise)
    for noise in (1.0, 4.0) if quick else (0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0):
        yield f"acceleration {noise:g}", ConstantAcceleration(noise)


def straight_flight(flight: Flight, settled: float = 5.0) -> Array:
    """Whether the target flies straight, and has for `settled` seconds, at each of the errors' steps."""
    t = np.arange(2, flight.steps + 1)
    straight = np.ones(len(t), dtype=bool)
    for turn in flight.turns:
        straight &= (t < turn.start) | (t > turn.end + settled)
    return straight


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Compare fixed EKFs, the paper's rules, the tuned rules and the IMM on C, D and E."""
    count = 30 if quick else 400
    data = tuned_data()
    claims: list[Claim] = []
    shown: dict[str, dict[str, Array]] = {}
    for name, flight in SCENARIOS.items():
        batch = Batch.draw([flight], count, rng)
        by_kind = []
        for turns in (False, True):
            tried = [(label, errors(ExtendedKalmanFilter(m), batch)) for label, m in fixed(turns, quick)]
            by_kind.append(min(tried, key=lambda one: one[1].mean()))
        (label, plain), (turn_label, turning) = by_kind
        literal = errors(FuzzyAdaptiveEKF(ConstantAcceleration(2.0), paper_rules(), paper_rules()), batch)
        tuned, mixed = errors(fuzzy_filter(data), batch), errors(imm(data["imm"]), batch)
        late_tuned = smoothed_errors(fuzzy_filter(data), batch, LAG)
        late_mixed = smoothed_errors(imm(data["imm"]), batch, LAG)

        def row(what: str, squared: Array, paper: float | None = None, name: str = name) -> Claim:
            return Claim(f"{name}: RMSE, {what}", "m", paper, rmse(squared), rmse_interval(squared))

        def ratio(what: str, other: Array, limit: float, ours: Array = tuned, name: str = name) -> Claim:
            interval = ratio_interval(ours, other, rng)
            return Claim(f"{name}: tuned rules / {what}", "", None, rmse(ours) / rmse(other), interval, (None, limit))

        claims += [
            Claim(f"{name}: RMSE, raw measurements", "m", 89.65, batch.raw),
            row(f"best fixed EKF ({label})", plain, 52.06),
            row(f"best fixed EKF with turn rate ({turn_label})", turning),
            row("the paper's rules, chosen sets", literal, 35.9),
            row("tuned rules", tuned),
            row("IMM", mixed),
            ratio("best fixed EKF", plain, 0.97),
            ratio("best fixed EKF with turn rate", turning, 0.97),
            ratio("IMM", mixed, 1.08),
            row(f"tuned rules, smoothed over {LAG} steps", late_tuned),
            row(f"IMM, smoothed over {LAG} steps", late_mixed),
            ratio(f"IMM, both smoothed over {LAG} steps", late_mixed, 1.08, late_tuned),
        ]
        straight = straight_flight(flight)
        for phase, rows in (("straight flight", straight), ("turns and 5 s after", ~straight)):
            for what, squared in (("tuned rules", tuned), ("IMM", mixed)):
                claims.append(Claim(f"{name}: RMSE in {phase}, {what}", "m", None, rmse(squared[rows])))
        shown[name] = {"best fixed EKF": plain, "paper's rules": literal, "tuned rules": tuned, "IMM": mixed}
    return claims, shown


def draw(figure: Any, shown: Any) -> None:
    """Draw the error over time for each scenario, turns shaded."""
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for panel, (name, results) in zip(panels, shown.items(), strict=True):
        for label, squared in results.items():
            panel.plot(np.arange(2, len(squared) + 2), np.sqrt(squared.mean(axis=1)), label=label, linewidth=1.2)
        for turn in SCENARIOS[name].turns:
            panel.axvspan(turn.start, turn.end, color="0.9")
        panel.axhline(89.7, color="black", linestyle=":", linewidth=0.8, label="raw measurements")
        panel.set(xlabel="time (s)", title=f"scenario {name}", ylim=(0, 250))
    panels[0].set_ylabel("RMSE of position (m)")
    panels[0].legend(fontsize=8, loc="upper left")


TITLE = "EKF with fuzzy inference (the paper's figures: its own trajectory, km x 1000)"


def program(arguments: list[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    return main("papers.fuzzy_ekf", TITLE, experiment, draw, (13, 4.2), arguments)


if __name__ == "__main__":
    raise SystemExit(program())
