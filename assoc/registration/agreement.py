"""Whether radars agree: their bearings, ranges and clocks beside the other radars, their noise beside their own plots.

Two plots of a radar in successive turns that may be of one target are a leg. At some instants the legs of one radar are
compared with those of the others: where both have one, both see a target. Biases of usual size are found by
`assoc.registration.register`; here are those that it cannot find: north turned by any angle, ranges in another unit,
clocks off by minutes or hours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from assoc._types import Array
from assoc.recordings.on_earth import USUAL_ALTITUDE
from assoc.recordings.recording import Recording
from assoc.recordings.several import heights_above
from assoc.scene.geodesy import Origin
from assoc.sensors import Radar2D

FASTEST = 350.0
"""No target flies faster, m/s."""
_METRES = {"nmi": 1852.0, "km": 1e3, "m": 1.0, "ft": 0.3048}
UNITS = {(was, read): _METRES[was] / _METRES[read] for was in _METRES for read in _METRES
         if was != read and "ft" not in (was, read) or {was, read} == {"ft", "m"}}  # fmt: skip
"""Factors that make ranges right, by the unit that they have and that for which it was taken."""
SHIFTS = [s for s in (*range(-120, 121, 4), *range(-50_400, 50_401, 1800)) if s]
"""Seconds by which clocks may differ: a little, or by time zones."""
FEWEST = 12
"""Places that two radars must have in common: fewer say nothing."""
_SHARE = 0.3
"""Share of the places below which another change is looked for, which must have 1.3 times as many in common."""
_INSTANTS, _MOST_PLOTS, _MOST_POINTS = 60, 40_000, 1_000
_STEP = math.radians(0.5)
_AROUND = 10
_APART, _FAR = 1e8, 1e5
# share of the turns in which something is seen where a thing stands
_STAYS = 0.25
# seconds between two reports of one target that make a leg
_LONGEST = 60.0


class Noise(NamedTuple):
    """Standard deviations of plots, metres and radians, about straight lines between those before and after."""

    range: float
    azimuth: float
    plots: int


@dataclass(frozen=True)
class Change:
    """What makes a radar's plots agree with others: azimuths turned (rad), ranges scaled, times shifted (s)."""

    turn: float = 0.0
    scale: float = 1.0
    shift: float = 0.0
    mirrored: bool = False
    """Bearings count counter-clockwise."""


@dataclass(frozen=True)
class Agreement:
    """One radar beside the others.

    ``places`` are where it sees targets that others could see; at ``common`` they do, after the ``change``: None if
    nothing makes them agree. ``turn`` and ``length`` are what is then left to add to its azimuths and ranges, and the
    standard deviation of that; radians and metres.
    """

    places: int = 0
    common: int = 0
    change: Change | None = None
    turn: tuple[float, float] = (0.0, math.inf)
    length: tuple[float, float] = (0.0, math.inf)


class Legs(NamedTuple):
    """Legs of a radar in the order of their beginnings; places as complex numbers, x + iy."""

    place: complex
    reach: float
    times: Array
    """Of both ends, (n, 2)."""
    ends: Array
    """From the radar, complex (n, 2)."""
    doubt: Array
    """Standard deviation of the ground range for want of a height, (n,)."""
    noise: Noise


def noise_of(recording: Recording, turn: float) -> Noise:
    """Noise of a radar by its own plots: most targets keep their course for three turns."""
    rows = _rows(recording.times, recording.positions, turn, _names(recording))
    known = np.flatnonzero(_names(recording)[rows[:, 0]].any(axis=1))
    # false plots make legs, too, but have no identity
    rows = rows[known] if len(known) > 100 else rows
    after: dict[int, list[int]] = {}
    for first, second in rows.tolist():
        after.setdefault(first, []).append(second)
    z = recording.positions @ np.array([1.0, 1j])
    left: dict[int, complex] = {}
    for first, middle in rows.tolist():
        for last in after.get(middle, ()):
            t = recording.times[[first, middle, last]]
            w = (t[1] - t[0]) / (t[2] - t[0])
            off = z[middle] - (1 - w) * z[first] - w * z[last]
            off /= math.sqrt(1 + w**2 + (1 - w) ** 2)
            if middle not in left or abs(off) < abs(left[middle]):
                left[middle] = off
    if len(left) < 3:
        return Noise(math.nan, math.nan, len(left))
    middle, off = np.array([*left]), np.array([*left.values()])
    # where clutter is dense some line fits any plot: what has one neighbour in the turn before and after tells more
    lone = (np.bincount(rows[:, 1], minlength=len(z)) == 1) & (np.bincount(rows[:, 0], minlength=len(z)) == 1)
    if np.count_nonzero(lone[middle]) > 100:
        middle, off = middle[lone[middle]], off[lone[middle]]
    along = off * np.conj(z[middle] / np.abs(z[middle]))
    angle = along.imag / np.abs(z[middle])
    return Noise(_deviation(along.real), _deviation(angle), len(left))


def standing_still(recording: Recording, turn: float) -> Array:
    """Which plots (n,) are of what stays in its place, as wind turbines, masts and buildings.

    In a cell of six standard deviations of the noise something is seen in a quarter of all turns, in the first and in
    the last half of the recording: no flight stays so long.
    """
    found = np.zeros(len(recording), dtype=np.bool_)
    noise = noise_of(recording, turn)
    if not noise.plots >= 3:
        return found
    z = np.stack([recording.ranges / max(noise.range, 1.0), recording.bearings / max(noise.azimuth, 1e-5)]) / 6.0
    turns = np.floor((recording.times - recording.times[0]) / turn)
    half = (turns[-1] + 1.0) / 2.0
    # what lies at the border of one cell is inside another
    for shift in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        cells, of = np.unique(np.floor(z.T + shift), axis=0, return_inverse=True)
        seen = np.unique(np.stack([of, turns]), axis=1)
        early, late = (np.bincount(seen[0, part].astype(int), minlength=len(cells))
                       for part in (seen[1] < half, seen[1] >= half))  # fmt: skip
        stays = (np.minimum(early, late) > 0) & (early + late >= np.maximum(_STAYS * 2.0 * half, 4.0))
        found |= stays[of]
    return found


def _deviation(values: Array) -> float:
    """Standard deviation about 0 without what is far out; values may come in steps, so that their median is 0."""
    size = np.abs(values)
    usual = float(np.quantile(size, 0.68))
    return float(np.sqrt(np.mean(np.minimum(size, 2.5 * usual) ** 2)))


def _names(recording: Recording) -> Array:
    return np.stack([recording.addresses, recording.identities], axis=1)


def _rows(times: Array, positions: Array, turn: float, names: Array) -> Array:
    """Rows (n, 2) of plots in successive turns that may be of one target, in the order of the first."""
    near = FASTEST * turn
    tree = KDTree(np.column_stack([positions, times * FASTEST / 1.5]))
    rows = np.sort(tree.query_pairs(1.5 * near, output_type="ndarray"), axis=1)
    apart = times[rows[:, 1]] - times[rows[:, 0]]
    way = np.linalg.norm(positions[rows[:, 1]] - positions[rows[:, 0]], axis=1)
    good = (apart > 0.5 * turn) & (apart < 1.5 * turn) & (way <= FASTEST * apart)
    both, same = (names[rows] > 0).all(axis=1), names[rows[:, 0]] == names[rows[:, 1]]
    good &= (~both | same).all(axis=1)
    rows = rows[good]
    return rows[np.argsort(rows[:, 0], kind="stable")]


def _legs(recording: Recording, radar: Radar2D, turn: float, origin: Origin, change: Change) -> Legs:
    """Legs of a radar, its plots scaled, shifted and mirrored, but not turned."""
    if len(recording) > _MOST_PLOTS:
        start = (len(recording) - _MOST_PLOTS) // 2
        recording = recording.take(np.arange(start, start + _MOST_PLOTS))
    noise = noise_of(recording, turn)
    if not noise.plots >= 30:
        sigma = np.sqrt(np.diagonal(radar.covariance))
        noise = Noise(float(sigma[0]), float(sigma[1]), noise.plots)
    slant, altitudes = change.scale * recording.ranges, recording.trusted_altitudes
    known = np.isfinite(altitudes)
    reach = change.scale * float(radar.field_of_view[0, 1])
    # a radar without heights that reaches less far sees ships, or targets that are low
    usual = float(np.median(altitudes[known])) if known.any() else USUAL_ALTITUDE if reach > _FAR else 0.0
    z = np.stack([slant, recording.azimuths], axis=1)
    up = heights_above(z, np.where(known, altitudes, usual), radar.position, origin) - radar.position[2]
    ground = np.sqrt(np.maximum(slant**2 - up**2, (0.5 * slant) ** 2))
    doubt = np.where(known, 30.0, 0.5 * usual) * np.abs(up) / np.maximum(ground, 1.0)
    ends = ground * np.exp(1j * recording.azimuths)
    ends = -np.conj(ends) if change.mirrored else ends
    times = recording.times + change.shift
    rows = _rows(times, np.stack([ends.real, ends.imag], axis=1), turn, _names(recording))
    return Legs(complex(*radar.position[:2]), reach, times[rows], ends[rows], doubt[rows[:, 0]], noise)


def reported(times: Array, places: Array, names: Array, noise: float) -> Legs:
    """Legs of targets that report where they are: x, y (n, 2) at times (n,), and who they are (n,), 0 if unknown."""
    order = np.lexsort((times, names))
    rows = np.stack([order[:-1], order[1:]], axis=1)
    apart = times[rows[:, 1]] - times[rows[:, 0]]
    rows = rows[(names[rows[:, 0]] == names[rows[:, 1]]) & (names[rows[:, 0]] > 0) & (apart > 0) & (apart <= _LONGEST)]
    rows = rows[np.argsort(times[rows[:, 0]], kind="stable")]
    ends = places[rows] @ np.array([1.0, 1j])
    return Legs(0j, math.inf, times[rows], ends, np.zeros(len(rows)), Noise(noise, 0.0, len(times)))


def _at(legs: Legs, instants: Array) -> tuple[Array, Array, Array]:
    """Where legs are at instants, from the radar (complex); the number of the instant; standard deviations, metres."""
    places, number, spread = [np.zeros(0, dtype=complex)], [np.zeros(0, dtype=int)], [np.zeros(0)]
    longest = float(np.diff(legs.times, axis=1).max(initial=0.0))
    lowest = np.searchsorted(legs.times[:, 0], instants - longest)
    highest = np.searchsorted(legs.times[:, 0], instants)
    for k, (t, low, high) in enumerate(zip(instants.tolist(), lowest.tolist(), highest.tolist(), strict=True)):
        (open_,) = np.nonzero(legs.times[low:high, 1] > t)
        begin, end = legs.times[low + open_].T
        w = (t - begin) / (end - begin)
        found = (1 - w) * legs.ends[low + open_, 0] + w * legs.ends[low + open_, 1]
        places.append(found)
        number.append(np.full(len(found), k))
        noise = legs.noise.range**2 + (np.abs(found) * legs.noise.azimuth) ** 2 + legs.doubt[low + open_] ** 2
        spread.append(np.sqrt(noise))
    return np.concatenate(places), np.concatenate(number), np.concatenate(spread)


class _Beside:
    """Places of one radar at some instants, and those of the others in a tree."""

    def __init__(self, mine: Legs, others: Sequence[Legs], turn: float) -> None:
        self.mine, self.others = mine, others
        begin = max(float(mine.times.min(initial=math.inf)), min(float(o.times.min(initial=math.inf)) for o in others))
        end = min(float(mine.times.max(initial=-math.inf)), max(float(o.times.max(initial=-math.inf)) for o in others))
        count = int(np.clip((end - begin) / turn, 0, _INSTANTS)) if end > begin else 0
        instants = begin + (np.arange(count) + 0.5) * (end - begin) / max(count, 1)
        self.off, self.number, self.spread = _at(mine, instants)
        seen = [_at(other, instants) for other in others]
        theirs = np.concatenate([z + other.place for (z, _, _), other in zip(seen, others, strict=True)])
        self.theirs = theirs
        self.their_spread = np.concatenate([spread for _, _, spread in seen])
        self.tree = KDTree(self._in_tree(theirs, np.concatenate([number for _, number, _ in seen])))
        if len(self.off) > _MOST_POINTS:
            chosen = np.linspace(0, len(self.off) - 1, _MOST_POINTS).astype(int)
            self.off, self.number, self.spread = self.off[chosen], self.number[chosen], self.spread[chosen]

    def _in_tree(self, z: Array, number: Array) -> Array:
        return np.stack([z.real, z.imag, _APART * number], axis=1)

    def hits(self, turned: complex, longer: float, slack: float) -> tuple[Array, Array]:
        """Whether each place is one of the others', and theirs less it (complex), once turned and lengthened."""
        off = (self.off + longer * self.off / np.maximum(np.abs(self.off), 1.0)) * turned
        if not len(off) or not self.tree.n:
            return np.zeros(len(off), dtype=np.bool_), off
        away, nearest = self.tree.query(self._in_tree(off + self.mine.place, self.number))
        gate = 3.0 * np.hypot(self.spread, self.their_spread[nearest]) + slack * np.abs(off)
        return away <= gate, (self.theirs[nearest] - off - self.mine.place) * np.conj(off / np.maximum(abs(off), 1.0))

    def best_turn(self) -> float | None:
        """The angle by which most places become common; None if no angle stands out."""
        angles = np.arange(-math.pi, math.pi, _STEP)
        counts = np.array([self.hits(np.exp(1j * a), 0.0, 0.5 * _STEP)[0].sum() for a in angles.tolist()])
        best = int(np.lexsort((np.abs(angles), -counts))[0])
        far = np.abs((np.arange(len(angles)) - best + len(angles) // 2) % len(angles) - len(angles) // 2) > _AROUND
        if counts[best] < FEWEST or counts[best] < 1.5 * counts[far].max(initial=0):
            return None
        return float(angles[best]) if abs(angles[best]) > 1.01 * _STEP else 0.0

    def agreement(self, change: Change) -> Agreement:
        """What is left after a change, by the places in common."""
        turn, length, angle, along = change.turn, 0.0, np.zeros(0), np.zeros(0)
        common = np.zeros(len(self.off), dtype=np.bool_)
        for slack in (0.5 * _STEP, 0.2 * _STEP, 0.0, 0.0):
            common, off = self.hits(np.exp(1j * turn), length, slack)
            if common.sum() < FEWEST:
                return Agreement(self._places(turn), int(common.sum()))
            angle, along = off.imag[common] / np.abs(self.off[common]), off.real[common]
            turn, length = turn + float(np.median(angle)), length + float(np.median(along))
        doubts = [1.25 * _deviation(x - np.median(x)) / math.sqrt(len(x)) for x in (angle, along)]
        places = max(self._places(turn), int(common.sum()))
        left = turn - change.turn
        return Agreement(places, int(common.sum()), change, (left, doubts[0]), (length, doubts[1]))

    def _places(self, turn: float) -> int:
        """Number of places that are within the reach of another."""
        where = self.off * np.exp(1j * turn) + self.mine.place
        within = np.zeros(len(where), dtype=np.bool_)
        for other in self.others:
            within |= np.abs(where - other.place) <= other.reach
        return int(within.sum())


class _Radar(NamedTuple):
    recording: Recording
    radar: Radar2D
    turn: float
    origin: Origin

    def legs(self, change: Change) -> Legs:
        return _legs(*self, change)


def compare(
    recordings: Sequence[Recording],
    radars: Sequence[Radar2D],
    turns: Sequence[float],
    origin: Origin,
    reports: Sequence[Legs] = (),
) -> list[Agreement]:
    """Compare each radar with the others.

    Parameters
    ----------
    recordings, radars : sequences
        In one frame, as `assoc.recordings.on_earth.placed` gives them.
    turns : sequence of float
        Seconds of a turn.
    reports : sequence of Legs, optional
        What targets report, see `reported`.
    origin : tuple
        Of the frame: latitude and longitude, radians, and height, metres.

    Returns
    -------
    list of Agreement
    """
    known = [_Radar(*each, origin) for each in zip(recordings, radars, turns, strict=True)]
    if len(known) + len(reports) < 2:
        return [Agreement() for _ in known]
    settled: dict[int, Agreement] = {}
    legs = [radar.legs(Change()) for radar in known]
    while True:
        seen = {
            s: _beside(known[s], [*legs[:s], *legs[s + 1 :], *reports]) for s in range(len(known)) if s not in settled
        }
        wrong = {s: one for s, one in seen.items() if one.change not in (None, Change())}
        if not wrong:
            return [{**seen, **settled}[s] for s in range(len(known))]
        # another that seems wrong beside it may be right once this one is
        s = max(wrong, key=lambda s: _share(wrong[s]))
        change = wrong[s].change
        assert change is not None
        settled[s] = wrong[s]
        turned = known[s].legs(change)
        legs[s] = turned._replace(ends=turned.ends * np.exp(1j * (change.turn + wrong[s].turn[0])))


def _beside(radar: _Radar, others: Sequence[Legs]) -> Agreement:
    """The change by which a radar agrees with others, none if possible."""
    plain = _Beside(radar.legs(Change()), others, radar.turn)
    turn = plain.best_turn()
    first = plain.agreement(Change(turn=turn or 0.0))
    if turn is None:
        first = replace(first, change=None)
    elif _share(first) >= _SHARE:
        return first
    found = []
    for change in (Change(mirrored=True), *(Change(scale=scale) for scale in UNITS.values())):
        tried = _Beside(radar.legs(change), others, radar.turn)
        turn = tried.best_turn()
        if turn is not None:
            found.append(tried.agreement(replace(change, turn=turn)))
    counts = []
    legs = radar.legs(Change())
    for shift in SHIFTS:
        tried = _Beside(legs._replace(times=legs.times + shift), others, radar.turn)
        counts.append((int(tried.hits(1.0, 0.0, 0.5 * _STEP)[0].sum()) / max(len(tried.off), 1), shift, tried))
    share, shift, tried = max(counts, key=lambda each: each[0])
    rivals = max((each[0] for each in counts if abs(each[1] - shift) > 60), default=0.0)
    if share > 1.5 * rivals:
        found.append(tried.agreement(Change(shift=shift)))
    best = max((one for one in found if one.change is not None), key=_share, default=first)
    return best if first.change is None or _share(best) > 1.3 * _share(first) else first


def _share(one: Agreement) -> float:
    return one.common / max(one.places, 1)
