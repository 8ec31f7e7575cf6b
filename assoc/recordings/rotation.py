"""Estimation of the rotation time from plots."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings.recording import Recording
from assoc.recordings.survey import StoredPlots

SHORTEST, LONGEST = 2.0, 30.0
"""Rotation times (s) that are tried. Below 2 s stamps in whole seconds do not distinguish them."""

STRETCH = 300.0
"""Length of a stretch, seconds, so that neither gaps nor a drifting motor matter."""

_MOST = 20_000
_MOST_FREQUENCIES = 10_000_000
_LEAST_COHERENCE = 0.5


@explains_wrong_types
def estimate_rotation(
    recording: Recording | StoredPlots, shortest: float = SHORTEST, longest: float = LONGEST
) -> float:
    """Estimate the rotation time of the antenna.

    An antenna that turns once in T seconds points to the bearing b when t / T - b / (2 pi) + const is whole. The T
    is taken at which the plots agree best on that constant: the maximum of ``|mean exp(i (2 pi t / T - b))|``, taken
    over stretches of five minutes and averaged. Where all traffic is in one direction, T / 2, T / 3 and so on
    agree nearly as well; the longest that agrees within 5 % is the answer.

    Parameters
    ----------
    recording : Recording or StoredPlots
    shortest, longest : float
        Limits of the search, seconds.

    Returns
    -------
    float
        Seconds.

    Raises
    ------
    InvalidInputError
        There are too few plots, or no rotation time fits them.
    """
    if not 0 < shortest < longest < math.inf:
        raise InvalidInputError(f"shortest, longest: expected 0 < shortest < longest, got {shortest}, {longest}")
    stretches = _stretches(recording)
    count = sum(len(time) for time, _ in stretches)
    span = max((float(time[-1] - time[0]) for time, _ in stretches), default=0.0)
    if count < 5 or span < 2 * shortest:
        raise InvalidInputError(f"the rotation time cannot be estimated from {count} plots over {span:g} s: give it")
    step = 1.0 / (8.0 * span)
    # at least a turn and a half is needed
    lowest = max(1.0 / longest, 1.5 / span)
    if (1.0 / shortest - lowest) / step > _MOST_FREQUENCIES:
        raise InvalidInputError(f"shortest: {shortest:g} s makes too many rotation times to try on {span:g} s of plots")
    frequencies = np.arange(lowest, 1.0 / shortest, step)
    if not len(frequencies):
        raise InvalidInputError(f"the rotation time cannot be estimated from {span:g} s of plots: give it")
    agreement = _agreement(stretches, frequencies)
    peaks = np.flatnonzero(
        (agreement >= np.concatenate([[-1.0], agreement[:-1]]))
        & (agreement >= np.concatenate([agreement[1:], [-1.0]]))
        & (agreement >= 0.95 * agreement.max())
    )
    best = int(peaks[0])
    # by chance one of so many frequencies agrees like this (Rayleigh)
    chance = math.sqrt(math.log(1000.0 * len(frequencies)) / count)
    least = max(_LEAST_COHERENCE, chance)
    if agreement[best] < least:
        backwards = _agreement([(time, -bearings) for time, bearings in stretches], frequencies).max() >= least
        raise InvalidInputError(
            f"no rotation time from {shortest:g} to {longest:g} s fits the plots "
            f"(agreement {agreement[best]:.2f} of 1): give it"
            + ("; one fits if bearings count counter-clockwise, or the antenna turns so" if backwards else "")
        )
    center = frequencies[best]
    for _ in range(3):
        step /= 8.0
        fine = center + step * np.arange(-8, 9)
        center = float(fine[np.argmax(_agreement(stretches, fine))])
    return 1.0 / float(center)


def _stretches(recording: Recording | StoredPlots) -> list[tuple[Array, Array]]:
    """Times (from the start of each stretch) and bearings, of stretches without long gaps."""
    # of a very long recording some stretches are enough
    every = max(1, -(-len(recording) // _MOST))
    found: list[tuple[Array, Array]] = []
    number = 0
    times = bearings = np.zeros(0)

    def take(end: int) -> None:
        """Take the stretch that ends there."""
        nonlocal times, bearings, number
        if end >= 2:
            if number % every == 0:
                found.append((times[:end] - times[0], bearings[:end]))
            number += 1
        times, bearings = times[end:], bearings[end:]

    for part in [recording] if isinstance(recording, Recording) else recording:
        times, bearings = np.concatenate([times, part.times]), np.concatenate([bearings, part.bearings])
        while len(times):
            wide = np.flatnonzero(np.diff(times) > 2 * LONGEST)
            end = int(np.searchsorted(times, times[0] + STRETCH, side="right"))
            end = min(end, int(wide[0]) + 1 if len(wide) else len(times))
            if end == len(times):
                break
            take(end)
    if len(times):
        take(len(times))
    return found


def _agreement(stretches: list[tuple[Array, Array]], frequencies: Array) -> Array:
    """Mean resultant length at each frequency (Hz), over the stretches, weighted by their plots."""
    total = np.zeros(len(frequencies))
    count = 0
    for times, bearings in stretches:
        total += np.abs(_sums(times, bearings, frequencies))
        count += len(times)
    return total / max(count, 1)


def _sums(times: Array, bearings: Array, frequencies: Array) -> Array:
    """Sums over the plots of exp(i (2 pi f t - b)) at frequencies in equal steps.

    Each is one of a few coarse frequencies and a fine one more: a product of two matrices, for which far fewer
    exponentials are taken.
    """
    fine = math.isqrt(len(frequencies)) + 1
    step = frequencies[1] - frequencies[0] if len(frequencies) > 1 else 0.0
    coarse = np.exp(1j * (np.outer(2 * math.pi * frequencies[::fine], times) - bearings))
    more = np.exp(2j * math.pi * step * np.outer(np.arange(fine), times))
    return np.asarray((coarse @ more.T).ravel()[: len(frequencies)])
