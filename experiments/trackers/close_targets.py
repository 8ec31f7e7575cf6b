"""Trackers where association is hard: formations, crossings, low P_d, many false alarms, mixed sensors.

Twelve targets, 40 scans of 4 s, default settings; GOSPA, OSPA(2) and HOTA with a cutoff of 500 m, identity switches a
scene and CPU time of a scan, beside an oracle that is told which measurement is whose. Seeds are --seed (200) and those
that follow, --seeds of them (20).
"""

from argparse import Namespace

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.close_scenes import SCANS, SETTINGS, simulate
from experiments.trackers.judging import NAMES, claims_of, goal, judge, means

SEEDS, FIRST = 20, 200
CLEARLY_BETTER = ("formations, unequal radars, P_d 0.6", "crossings", "crossings, P_d 0.6")
"""Where the MHT should win: low P_d, and crossings."""


def experiment(chosen: Namespace) -> list[Claim]:
    """Trackers of these names on all scenes."""
    claims: list[Claim] = []
    quick, seeds = chosen.quick, range(chosen.seed, chosen.seed + (2 if chosen.quick else chosen.seeds))
    for label, setting in list(SETTINGS.items())[: 2 if quick else None]:
        scenes = [simulate(setting, seed, 8 if quick else SCANS) for seed in seeds]
        found = {name: [judge(name, scene) for scene in scenes] for name in chosen.names}
        for name, runs in found.items():
            claims += claims_of(label, name, runs)
        if not {"mht", "multi-sensor"} <= set(found):
            continue
        difference = means(found["mht"]) - means(found["multi-sensor"])
        claims.append(goal(f"{label}: GOSPA, mht - multi-sensor", "m", difference, 0.0, surely=label in CLEARLY_BETTER))
    return claims


if __name__ == "__main__":
    raise SystemExit(main(
        "trackers.close_targets", experiment, __doc__, only=NAMES, seeds=(SEEDS, "scenes of each kind"),
        said=" {seeds} scenes of each kind.", seed=FIRST,
    ))  # fmt: skip
