"""Kinds of targets by name: how fast they are and how they manoeuvre, for the priors of trackers."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene

# the first scans, by which "auto" decides
SCANS = 50


class TargetKind(NamedTuple):
    """Priors that suit a kind of target."""

    speed: float
    """Standard deviation of the velocity along an axis, m/s; see `assoc.tracking.Initiation`."""
    acceleration: float
    """In a manoeuvre, m/s^2."""
    duration: float
    """Seconds for which a manoeuvre lasts."""
    falls: bool = False
    """Whether they fly free, under gravity: see `assoc.filters.FreeFlight`."""

    def noise(self, pace: float) -> float:
        """Process noise for scans `pace` seconds apart, m/s^1.5: a manoeuvre's change of velocity from scan to scan."""
        return self.acceleration * self.duration / math.sqrt(max(pace, self.duration))


TARGETS = {
    "airliner": TargetKind(150.0, 4.0, 10.0),
    "fighter": TargetKind(300.0, 50.0, 1.0),
    "ship": TargetKind(5.0, 0.2, 5.0),
    "drone": TargetKind(12.0, 5.0, 2.0),
    "pedestrian": TargetKind(1.5, 1.0, 1.0),
    "missile": TargetKind(1000.0, 100.0, 1.0, True),
    "ballistic": TargetKind(1500.0, 20.0, 2.0, True),
    "satellite": TargetKind(4500.0, 1.0, 1.0, True),
}
"""Kinds by name: turns of 25 degrees of bank, of 5 g, of a rudder, of 0.5 g, steps aside, 10 g of a motor or fins, 2 g
of drag, and hardly anything."""


def target_kind(name: str, scene: Scene | None, make: Callable[..., Any]) -> TargetKind:
    """The kind of this name; "auto" is the one with which the trackers of `make` track a scene's first scans best."""
    if name != "auto":
        if name not in TARGETS:
            raise InvalidInputError(f"targets: unknown name {name!r}; known: {', '.join(TARGETS)}, auto")
        return TARGETS[name]
    if scene is None:
        raise InvalidInputError(f"targets: auto needs a scene; name one of {', '.join(TARGETS)}")
    evidence = {kind: evidence_of(make(scene, targets=kind), scene) for kind in TARGETS}
    return TARGETS[max(evidence, key=lambda kind: evidence[kind])]


def slower_kind(speed: float, evidence: Callable[[str], float], least: float = 0.0) -> str:
    """The kind slower than a prior of this speed, m/s, with the most evidence for its tracks; "" if none has so much.

    A prior that is wide beside the region leaves slow targets without a track, or makes many of false alarms, so that
    no speed of theirs is known. The prior itself has `least`.
    """
    found = {kind: evidence(kind) for kind, priors in TARGETS.items() if 2.0 * priors.speed < speed}
    best = max(found, key=lambda kind: found[kind], default="")
    return best if best and found[best] > least else ""


def evidence_in(tracker: Any, steps: Iterable[object]) -> float:
    """What the confirmed tracks score over the steps of a tracker: how much likelier these targets make the plots.

    Tracks that ended count, and what a track scored before it began anew under its number: else one sharp turn near
    the end would count against a kind all that it had explained.
    """
    lives = defaultdict[int, list[tuple[float, float, float]]](list)
    for _ in steps:
        for track in tracker.tracks:
            if track.confirmed:
                lives[track.track_id].append((track.started, track.time, float(track.score)))
    total = 0.0
    for life in lives.values():
        began, _, score = life[-1]
        total += score
        for started, time, score in reversed(life):
            # from where it began anew on, its plots are of its new score
            if time < began:
                began, total = started, total + score
    return total


def evidence_of(tracker: Any, scene: Scene) -> float:
    """What the confirmed tracks of a scene's first scans score."""
    scans = map(scene.scan, range(min(scene.num_scans, SCANS)))
    return evidence_in(tracker, (tracker.step(one.time, one.measurements, one.times, one.sectors) for one in scans))
