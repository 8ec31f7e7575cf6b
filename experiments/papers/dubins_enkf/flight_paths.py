"""Figures 2 and 3: Dubins paths without and with an obstacle. The paper prints no length of any path.

What it prints are the ends: (-500, 100) to (0, 200) without an obstacle, (-407.7151, 149.8384) to (-5.6824, 126.9565)
with one at (-250, 150) of radius 30; turning radius 100, headings pi/3 and 0. Its path around the obstacle (SRS,
figures 1 and 3) is a straight line to a tangent point of the obstacle, an arc along it, a straight line to the goal.
Equations 5 to 7 allow a radius at each end, where the package's paths have one: the paper's steps are done here.
"""

import math
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.simulation.dubins.obstacles import around
from assoc.simulation.dubins.paths import Path, Pose, path, paths, shortest
from experiments.common.claims import Claim

FIRST = Pose(-500.0, 100.0, math.pi / 3)
LAST = Pose(0.0, 200.0, 0.0)
PRINTED = (Pose(-407.7151, 149.8384, math.pi / 3), Pose(-5.6824, 126.9565, 0.0))
RADIUS = 100.0
FOUR = ("RSR", "LSR", "RSL", "LSL")
OBSTACLE = (-250.0, 150.0, 30.0)


def srs(start: Pose, goal: Pose, circle: tuple[float, float, float]) -> tuple[Array, Array, float]:
    """The paper's path: straight, right turn along the obstacle, straight.

    first, second: (2,) arrays. Tangent points T1 and T2 on the circle.
    length: Metres.
    """
    centre, r = np.array(circle[:2]), circle[2]
    touches = []
    for pose, side in ((start, -1.0), (goal, 1.0)):
        # a right turn passes the circle on its left: above it, when flying to the east
        off = np.array([pose.x, pose.y]) - centre
        angle = math.atan2(off[1], off[0]) + side * math.acos(r / float(np.hypot(*off)))
        touches.append(centre + r * np.array([math.cos(angle), math.sin(angle)]))
    first, second = touches
    turn = _angle(first - centre) - _angle(second - centre)
    ends = [np.array([pose.x, pose.y]) for pose in (start, goal)]
    legs = float(np.linalg.norm(first - ends[0]) + np.linalg.norm(ends[1] - second))
    return first, second, legs + r * (turn % (2 * math.pi))


def by_steps(start: Pose, goal: Pose, radii: tuple[float, float], word: str) -> float | None:
    """Length of LSL, LSR, RSL or RSR by the steps of section c: centres (5), tangent, arcs (6); None by equation 7."""
    senses = [1.0 if letter == "L" else -1.0 for letter in (word[0], word[2])]
    first, second = (
        np.array([pose.x, pose.y]) + sense * r * np.array([-math.sin(pose.heading), math.cos(pose.heading)])
        for pose, sense, r in zip((start, goal), senses, radii, strict=True)
    )
    c = float(np.hypot(*(second - first)))
    off = (senses[0] * radii[0] - senses[1] * radii[1]) / c
    if abs(off) > 1:
        return None
    line = _angle(second - first) + math.asin(off)
    turns = (senses[0] * (line - start.heading), senses[1] * (goal.heading - line))
    arcs = sum(r * (turn % (2 * math.pi)) for r, turn in zip(radii, turns, strict=True))
    return c * math.sqrt(1 - off**2) + arcs


def _angle(vector: Array) -> float:
    return math.atan2(vector[1], vector[0])


def judge() -> tuple[list[Claim], dict[str, Any]]:
    """Compare our paths with what the paper prints and shows."""
    chosen, by_word = "chosen by us", {path.word: path for path in paths(FIRST, LAST, RADIUS)}
    best = shortest(FIRST, LAST, RADIUS)
    claims = [
        Claim(f"without obstacle: length of {word}", "m", None, path.length, source="the paper prints no length")
        for word, path in by_word.items()
    ]
    claims.append(
        Claim("without obstacle: shortest of the paper's four words, less RSR", "m", None,
              best.length - by_word["RSR"].length, None, (0.0, 0.0), source="figure 2: RSR is the optimum")
    )  # fmt: skip
    off = [abs((by_steps(FIRST, LAST, (RADIUS, RADIUS), word) or math.inf) - by_word[word].length) for word in FOUR]
    claims.append(Claim("r_s = r_f: largest difference of the four lengths by the paper's steps from ours", "m", None,
                        max(off), None, (None, 1e-9), source="equations 5 and 6"))  # fmt: skip
    claims += [
        Claim(f"r_s 100, r_f 50 m: length of {word} by the paper's steps", "m", None, length, source=chosen)
        for word in FOUR if (length := by_steps(FIRST, LAST, (RADIUS, RADIUS / 2), word)) is not None
    ]  # fmt: skip
    # where the printed points come from: tangent points of another goal, found by the reading of heading and radius
    second = path(FIRST, Pose(0.0, 100.0 + 100.0 * math.tan(math.radians(15.0)), 0.0), RADIUS, "RSL")
    for pose, printed, where in (
        (second.segments[1].start, PRINTED[0], "start"),
        (second.segments[1].end, PRINTED[1], "end"),
    ):
        for axis in ("x", "y"):
            value, figure = getattr(pose, axis), getattr(printed, axis)
            claims.append(
                Claim(f"with obstacle: {axis} of the {where}, as a tangent point of the RSL path to (0, 126.795)", "m",
                      figure, value, None, (figure - 5e-5, figure + 5e-5),
                      source="figure 3, start and end of the path; the RSL path is our explanation")
            )  # fmt: skip
    claims.append(Claim("with obstacle: heading of that path at the printed points", "deg", None,
                        math.degrees(second.segments[1].start.heading), source="section d: pi / 3 and 0"))  # fmt: skip
    start, goal = PRINTED
    first, last, length = srs(start, goal, OBSTACLE)
    kinks = (
        abs(math.remainder(_angle(first - np.array([start.x, start.y])) - start.heading, 2 * math.pi)),
        abs(math.remainder(_angle(np.array([goal.x, goal.y]) - last) - goal.heading, 2 * math.pi)),
    )
    direct = shortest(start, goal, RADIUS)
    free = around(start, goal, RADIUS, [OBSTACLE])
    wide = around(FIRST, LAST, RADIUS, [OBSTACLE])
    claims += [
        Claim("with obstacle: radius of the turn of the paper's SRS path", "m", None, OBSTACLE[2], None,
              (RADIUS, None), source="figure 3; the aircraft's radius is 100 m"),
        Claim("with obstacle: kink at the start of the SRS path", "deg", None, math.degrees(kinks[0]), None,
              (0.0, 1.0), source="figure 3; at most 1 deg chosen by us"),
        Claim("with obstacle: kink at the end of the SRS path", "deg", None, math.degrees(kinks[1]), None,
              (0.0, 1.0), source="figure 3; at most 1 deg chosen by us"),
        Claim("with obstacle: length of the SRS path with its kinks", "m", None, length,
              source="figure 3, our arithmetic"),
        Claim(f"with obstacle: length of the shortest path that can be flown ({free.word})", "m", None, free.length,
              source=chosen),
        Claim("with obstacle: clearance of the shortest path that does not look at the obstacle", "m", None,
              direct.clearance([OBSTACLE]), source=chosen),
        Claim("with obstacle: clearance of the path flown", "m", None, free.clearance([OBSTACLE]), None, (0.0, None),
              source=chosen),
        Claim("with obstacle: tightest turn of the path flown", "m", None, _tightest(free), None,
              (RADIUS * (1 - 1e-12), None), source="section d: radius 100 m"),
        Claim("obstacle between the ends of figure 2: length of the path flown", "m", None, wide.length, source=chosen),
        Claim("obstacle between the ends of figure 2: clearance", "m", None, wide.clearance([OBSTACLE]), None,
              (0.0, None), source=chosen),
        Claim("obstacle between the ends of figure 2: tightest turn", "m", None, _tightest(wide), None,
              (RADIUS * (1 - 1e-12), None), source=chosen),
    ]  # fmt: skip
    for name, plain, flown in (("figure 2", best, wide), ("figure 3", direct, free)):
        longer = flown.length - plain.length
        for what, unit, value in (("metres", "m", longer), ("seconds at 20 m/s", "s", longer / 20.0)):
            claims.append(Claim(f"between the ends of {name}: {what} that the obstacle costs", unit, None, value,
                                source="introduction: least length and so time"))  # fmt: skip
    return claims, {"best": best, "free": free, "wide": wide, "srs": (start, first, last, goal)}


def _tightest(path: Path) -> float:
    return 1 / max(abs(segment.curvature) for segment in path.segments)


def draw(left: Any, right: Any, shown: dict[str, Any]) -> None:
    """Figure 2 with our path around the obstacle, and figure 3 with ours beside the paper's."""
    for panel in (left, right):
        turn = np.linspace(0, 2 * np.pi, 100)
        panel.fill(
            OBSTACLE[0] + OBSTACLE[2] * np.cos(turn), OBSTACLE[1] + OBSTACLE[2] * np.sin(turn), color="0.8",
            label="obstacle",
        )  # fmt: skip
        panel.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    for name, label, style in (("best", "shortest, as figure 2", "--"), ("wide", "around the obstacle", "-")):
        path = shown[name]
        points = path.sample(20.0, 0.05)[1]
        left.plot(points[:, 0], points[:, 1], style, label=f"{label}: {path.word}, {path.length:.1f} m")
    start, first, last, goal = shown["srs"]
    corners = np.array([(start.x, start.y), first, last, (goal.x, goal.y)])
    centre = np.array(OBSTACLE[:2])
    begin, end = _angle(first - centre), _angle(last - centre)
    sweep = np.linspace(begin, begin - (begin - end) % (2 * np.pi), 40)
    arc = centre + OBSTACLE[2] * np.stack([np.cos(sweep), np.sin(sweep)], axis=1)
    points = np.concatenate([corners[:1], arc, corners[-1:]])
    right.plot(points[:, 0], points[:, 1], "C3--", label="the paper's SRS path, with kinks")
    points = shown["free"].sample(20.0, 0.05)[1]
    right.plot(points[:, 0], points[:, 1], "C1", label=f"flown: {shown['free'].word}, {shown['free'].length:.1f} m")
    for pose in (start, goal):
        right.annotate(
            "", (pose.x + 30 * math.cos(pose.heading), pose.y + 30 * math.sin(pose.heading)), (pose.x, pose.y),
            arrowprops={"arrowstyle": "->"},
        )  # fmt: skip
    left.set(xlim=(-520, 30), ylim=(0, 260))
    right.set(xlim=(-520, 30), ylim=(0, 260))
    left.legend(fontsize=8, loc="lower right")
    right.legend(fontsize=8, loc="lower left")
