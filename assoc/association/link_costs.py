"""What links between points cost: candidates within range, prices, and what links say about both."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from assoc._system import memory as memory_left
from assoc._types import Array

_INCLUSIVE = 1e-9  # by what share a step of just the search range is worth a link
_BYTES = 400.0  # of each candidate pair while its problem is built and solved
_STEPS, _NEIGHBOURS = 3, 5
"""A particle's velocity is that of its last steps; one that begins moves as its neighbours do."""


class Points(NamedTuple):
    """N points of K frames, one frame after the other."""

    places: Array
    """(N, D)."""
    first: Array
    """First point of each frame, and N, (K + 1,)."""

    @property
    def frame(self) -> Array:
        """Frame of each point, (N,)."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))


class Pairs(NamedTuple):
    """P candidates for links."""

    ends: Array
    """A point and a later one, (P, 2)."""
    squares: Array
    """Squared distance from where the first point leads to, for each frame between them, (P,)."""
    gaps: Array
    """Frames from one to the other, (P,)."""

    def within(self, gap: int) -> Pairs:
        """The candidates over at most so many frames."""
        kept = self.gaps <= gap
        return Pairs(self.ends[kept], self.squares[kept], self.gaps[kept])

    def of(self, chosen: Array) -> Pairs:
        """The candidates that are chosen links (K, 2)."""
        count = int(self.ends.max(initial=0)) + 1
        keys = self.ends[:, 0] * count + self.ends[:, 1]
        kept = np.isin(keys, chosen[:, 0] * count + chosen[:, 1])
        return Pairs(self.ends[kept], self.squares[kept], self.gaps[kept])


@dataclass(frozen=True)
class LinkCosts:
    """Prices in squared units of the points; see ``assoc.link``."""

    reach: float
    memory: int
    start: float | None
    end: float | None
    skip: float | None
    divisions: float | None
    merges: float | None
    learnt_skip: float = 0.0
    spread: float = 0.0
    """Variance of a step times the number of axes, from the links; 0 before there are any."""

    @property
    def skip_price(self) -> float:
        """Of a skipped frame."""
        return self.learnt_skip if self.skip is None else self.skip

    @property
    def learns_ends(self) -> bool:
        """Whether links say what ends and beginnings cost beyond the search range."""
        given = (self.start, self.end, self.skip, self.divisions, self.merges)
        return not self.memory and all(price is None for price in given)

    def of_end(self) -> tuple[float, float]:
        """Of a particle that begins, and of one that ends."""
        missed = self.skip_price if self.memory or self.learns_ends else 0.0
        half = 0.5 * ((1.0 + _INCLUSIVE) * self.reach**2 + missed)
        return half if self.start is None else self.start, half if self.end is None else self.end

    def of_links(self, pairs: Pairs) -> Array:
        """Of links, in place of an end and a beginning, (P,)."""
        # the density of a step over several frames is lower, as it spreads
        wider = self.spread * np.log(pairs.gaps) if self.skip is None else 0.0
        return pairs.squares + (pairs.gaps - 1) * self.skip_price + wider - sum(self.of_end())

    def settled(self, before: LinkCosts) -> bool:
        """Whether prices are as before, within a tenth."""
        return abs(self.skip_price - before.skip_price) <= 0.1 * before.skip_price and before.spread > 0.0


def candidates(points: Points, moved: Array, reach: float, memory: int) -> Pairs:
    """Pairs of points within reach; `moved` is what each point, (N, D), or all, (1, D), move in a frame."""
    # quarter of a second to import
    from scipy.spatial import cKDTree

    first, places = points.first, points.places
    frames = [places[low:high] for low, high in pairwise(first)]
    led = np.broadcast_to(moved, places.shape)
    trees = [cKDTree(frame) for frame in frames]
    ends, squares, gaps = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)], [np.empty(0, dtype=np.int64)]
    count = 0
    for k, frame in enumerate(frames):
        for gap in range(1, min(memory + 1, len(frames) - 1 - k) + 1):
            if not (len(frame) and len(frames[k + gap])):
                continue
            ahead = cKDTree(frame + gap * led[first[k] : first[k + 1]]) if moved.any() else trees[k]
            wide = reach * gap**0.5
            count += ahead.count_neighbors(trees[k + gap], wide)
            memory_left.require(_BYTES * count, f"{count} pairs within search_range", "lower it, or memory")
            found = ahead.sparse_distance_matrix(trees[k + gap], wide, output_type="ndarray")
            ends.append(np.column_stack([found["i"] + first[k], found["j"] + first[k + gap]]))
            squares.append(found["v"] ** 2 / gap)
            gaps.append(np.full(len(found), gap))
    return Pairs(np.concatenate(ends), np.concatenate(squares), np.concatenate(gaps))


def learnt(costs: LinkCosts, links: Pairs, points: Points, candidates: int) -> LinkCosts:
    """The prices that links, of so many candidates, suggest: points are missing as often as links skip frames."""
    if not len(links.gaps):
        return costs
    spread = float(links.squares.mean())
    if costs.learns_ends:
        missed = max(_end_and_beginning(costs.reach, links, points, candidates) - costs.reach**2, 0.0)
        return replace(costs, spread=spread, learnt_skip=missed)
    variance = spread / points.places.shape[1]
    # before any frame could be skipped, one of twenty is a guess that later rounds correct
    guessed = costs.spread == 0.0
    missing = 0.05 if guessed else (float((links.gaps - 1).sum()) + 0.5) / (float(links.gaps.sum()) + 1.0)
    skip = -2.0 * variance * np.log(missing) if costs.memory and costs.skip is None else 0.0
    return replace(costs, spread=spread, learnt_skip=float(skip))


def _end_and_beginning(reach: float, links: Pairs, points: Points, candidates: int) -> float:
    """From where on a squared step is less likely than an end and a beginning, one as frequent as the other."""
    dim, count = points.places.shape[1], float(points.first[-2])
    variance = max(float(links.squares.mean()) / dim, 1e-12 * reach**2, sys.float_info.min)
    ended = (count - len(links.gaps) + 0.5) / (count + 1.0)
    # of points, as wrong candidates show it, in the ball within reach
    ball = 0.5 * dim * math.log(math.pi) - math.lgamma(0.5 * dim + 1.0) + dim * math.log(reach)
    density = math.log((candidates - len(links.gaps) + 0.5) / (count + 1.0)) - ball
    step = math.log1p(-ended) - 0.5 * dim * math.log(2.0 * math.pi * variance)
    return 2.0 * variance * (step - 2.0 * math.log(ended) - density)


def velocities(points: Points, links: Array, moved: Array) -> Array:
    """What each point moves in a frame, by the links (K, 2) of its particle and of its neighbours, (N, D)."""
    from scipy.spatial import cKDTree

    places, frame, count = points.places, points.frame, len(points.places)
    before, after = np.full((2, count), -1)
    before[links[:, 1]], after[links[:, 0]] = links[:, 0], links[:, 1]
    speed, steps = np.zeros(places.shape), np.zeros(count, dtype=np.int64)
    for low, high in pairwise(points.first):
        here = np.flatnonzero(before[low:high] >= 0) + low
        earlier = before[here]
        step = (places[here] - places[earlier]) / (frame[here] - frame[earlier])[:, None]
        steps[here] = steps[earlier] + 1
        speed[here] = speed[earlier] + (step - speed[earlier]) / np.minimum(steps[here], _STEPS)[:, None]
    # a particle that begins moves as it does in its next step, if its next ones agree; others as their neighbours do
    begins = np.flatnonzero((steps == 0) & (after >= 0))
    begins = begins[after[after[begins]] >= 0]
    speed[begins] = speed[after[after[begins]]]
    known = steps > 0
    known[begins] = True
    for low, high in pairwise(points.first):
        told, open_ = np.flatnonzero(known[low:high]) + low, np.flatnonzero(~known[low:high]) + low
        if len(open_) and len(told) >= _NEIGHBOURS:
            nearest = cKDTree(places[told]).query(places[open_], _NEIGHBOURS)[1]
            speed[open_] = np.median(speed[told][nearest], axis=1)
        elif len(open_):
            speed[open_] = np.broadcast_to(moved, places.shape)[open_]
    return speed
