"""Groupings that ignore the antenna, for comparison with the clustering time window."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.windows import MOST_TURNS, Window, windows_of

MOST_GROUPS = 10_000_000


@explains_wrong_types
def irregular_groups(
    recording: Recording, rng: np.random.Generator, mean: float = 6.2, shape: float = 2.0
) -> list[Window]:
    """Group plots by intervals of irregular length, as the paper's data come without a window.

    The paper has 183 groups for 119 rotations, some shorter and some longer than one, and does not explain
    their lengths. Here they are gamma-distributed.

    Parameters
    ----------
    recording : Recording
    rng : numpy.random.Generator
    mean : float, default 6.2
        Of the lengths, seconds.
    shape : float, default 2
        Of the gamma distribution; with 2 about a fifth of the groups are longer than 9.5 s.

    Returns
    -------
    list of Window
        Without empty ones.
    """
    if not 0 < mean < math.inf or not 0 < shape < math.inf:
        raise InvalidInputError(f"mean, shape: expected numbers > 0, got {mean!r}, {shape!r}")
    if not len(recording):
        return []
    start, end = float(recording.times[0]), float(recording.times[-1])
    edges: list[float] = []
    reached = start
    while reached <= end:
        # drawn in blocks; gaps of hours take as many groups as they last
        lengths = np.cumsum(rng.gamma(shape, mean / shape, 256))
        edges.extend((reached + lengths).tolist())
        reached = edges[-1]
        if len(edges) > MOST_GROUPS:
            raise InvalidInputError(f"mean, shape: {mean:g}, {shape:g} make more than {MOST_GROUPS} groups")
    return windows_of(recording, np.searchsorted(np.array(edges), recording.times, side="right"))


@explains_wrong_types
def fixed_groups(recording: Recording, seconds: float) -> list[Window]:
    """Group plots by intervals of one length that is not the antenna's, from the first plot on."""
    if not 0 < seconds < math.inf:
        raise InvalidInputError(f"seconds: expected a number > 0, got {seconds!r}")
    if not len(recording):
        return []
    span = float(recording.times[-1] - recording.times[0])
    if not span / seconds < MOST_TURNS:
        raise InvalidInputError(f"seconds: {seconds:g} s is too short for a recording of {span:g} s")
    return windows_of(recording, np.floor((recording.times - recording.times[0]) / seconds).astype(np.int64))


@explains_wrong_types
def groups_of_sizes(recording: Recording, sizes: Sequence[int]) -> list[Window]:
    """Group plots by given numbers of plots, in the order of time.

    Parameters
    ----------
    recording : Recording
    sizes : sequence of int
        At least 1 each; together as many as there are plots.
    """
    if any(int(size) != size or size < 1 for size in sizes) or sum(sizes) != len(recording):
        expected = f"whole numbers >= 1 that add up to {len(recording)}"
        raise InvalidInputError(f"sizes: expected {expected}, got {list(sizes)}")
    return windows_of(recording, np.repeat(np.arange(len(sizes)), np.asarray(sizes, dtype=np.int64)))
