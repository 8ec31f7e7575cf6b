"""Trackers where association is hard: formations, crossings, low P_d, many false alarms, mixed sensors.

    python -m experiments.trackers.close_targets [--quick] [--seeds N] [--seed N] [--json FILE] [--figure FILE]
                                                 [--only NAME ...] [--publish]

Twelve targets, 40 scans of 4 s, default settings; GOSPA, OSPA(2) and HOTA with a cutoff of 500 m, identity switches a
scene and CPU time of a scan, beside an oracle that is told which measurement is whose. Seeds are --seed (200) and those
that follow, --seeds of them (20).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import add_only, make_parser, run
from experiments.trackers.close_scenes import SCANS, SETTINGS, simulate
from experiments.trackers.judging import NAMES, Judged, claims_of, goal, judge, means

SEEDS, FIRST = 20, 200
CLEARLY_BETTER = ("formations, unequal radars, P_d 0.6", "crossings", "crossings, P_d 0.6")
"""Where the MHT should win: low P_d, and crossings."""


def experiment(
    quick: bool, seed: int, seeds: int = SEEDS, names: Sequence[str] = NAMES
) -> tuple[list[Claim], dict[str, dict[str, list[Judged]]]]:
    """Trackers of these names on all scenes."""
    claims: list[Claim] = []
    shown: dict[str, dict[str, list[Judged]]] = {}
    for label, setting in list(SETTINGS.items())[: 2 if quick else None]:
        scenes = [simulate(setting, seed + k, 8 if quick else SCANS) for k in range(2 if quick else seeds)]
        found = {name: [judge(name, scene) for scene in scenes] for name in names}
        shown[label] = found
        for name, runs in found.items():
            claims += claims_of(label, name, runs)
        if not {"mht", "multi-sensor"} <= set(found):
            continue
        difference = means(found["mht"]) - means(found["multi-sensor"])
        claims.append(goal(f"{label}: GOSPA, mht - multi-sensor", "m", difference, 0.0, surely=label in CLEARLY_BETTER))
    return claims, shown


def draw(figure: Any, shown: dict[str, dict[str, list[Judged]]]) -> None:
    """GOSPA and identity switches of each tracker in each scene."""
    labels, names = list(shown), list(next(iter(shown.values())))
    width = 0.8 / len(names)
    for axes, title in zip(figure.subplots(1, 2, sharey=True), ("GOSPA, m", "switches"), strict=True):
        for i, name in enumerate(names):
            runs = [shown[label][name] for label in labels]
            switches = [np.mean([one.switches for one in each]) for each in runs]
            lengths = switches if title == "switches" else [means(each).mean() for each in runs]
            axes.barh(np.arange(len(labels)) + width * (i - (len(names) - 1) / 2), lengths, width, label=name)
        axes.set_xlabel(title)
        axes.set_yticks(np.arange(len(labels)), labels, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    axes.invert_yaxis()
    axes.legend(fontsize=8, frameon=False)


NAME, TITLE = "trackers.close_targets", "Trackers where association is hard"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, TITLE)
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="N", help=f"scenes of each kind (default {SEEDS})")
    add_only(parser, NAMES)
    parser.set_defaults(seed=FIRST)
    chosen = parser.parse_args(arguments)
    if chosen.seeds < 2:
        parser.error("--seeds must be at least 2")
    about = f"{__doc__} {chosen.seeds} scenes of each kind."
    return run(
        parser, chosen, NAME, TITLE,
        lambda quick, rng: experiment(quick, chosen.seed, chosen.seeds, chosen.only or NAMES), draw, (11, 6), about,
    )  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
