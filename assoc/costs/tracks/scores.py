"""Track scores: log likelihood ratios of "these measurements are one target" against "all are false alarms".

One code for all trackers. In the notation of Blackman and Popoli, a track's score is its log likelihood ratio,

    L = ln(beta_NT / beta_FA)                      when it starts (beta: densities in measurement space)
      + ln(P_D N(z; expected, S) / beta_FA)        for each detection
      + ln(1 - P_D)                                for each miss,

and the cost of a tuple that contains a track is the negative of what the tuple adds to it. Summed over the
tracks of a hypothesis it is, up to a constant, the logarithm of the hypothesis' probability (equation 2.1 of
the thesis on clustering time windows, with P_FA = beta_FA and P_NT = beta_NT, N_d the detected targets).

References
----------
S. Blackman, R. Popoli, Design and Analysis of Modern Tracking Systems, 1999, section 6.2.
R. W. Sittler, An optimal data association problem in surveillance theory, IEEE Trans. Military Electronics 8, 1964.
D. B. Reid, An algorithm for tracking multiple targets, IEEE Trans. Automatic Control 24, 1979.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from assoc._system.compiled import for_kernels, njit
from assoc._types import Array
from assoc.sensors.base import Sensor


class ScoreTerms(NamedTuple):
    """Terms of the score for a scan of each of S sensors, without the likelihood of the measurement."""

    detection: Array
    """ln(P_D / beta_FA) with beta_FA = r / V, (S,)."""
    miss: Array
    """ln(1 - P_D), (S,)."""
    birth: Array
    """ln(P_D / beta_FA) - 1/2 ln det(2 pi R) of the components that depend on the position, (S,): with `log_birth` of
    the position's covariance the score of a single measurement as a new target."""
    peak: Array
    """-1/2 ln det(2 pi R): the most that a log likelihood of a measurement can be, (S,)."""
    by_range: Array | None = None
    """P_D in each band of range over the sensor's, (S, B), at most 1; None: the same everywhere. See
    `assoc.costs.views`."""


def score_terms(sensors: Sequence[Sensor], by_range: Array | None = None) -> ScoreTerms:
    """Terms of the score."""
    P = np.array([sensor.detection_probability for sensor in sensors])
    density = np.array([sensor.false_alarm_rate / sensor.volume for sensor in sensors])
    # range rates are as likely for a new target as for a false alarm
    located = [sensor.position_part for sensor in sensors]
    there = np.array([part.false_alarm_rate / part.volume for part in located])
    spread = np.array([np.linalg.slogdet(2.0 * math.pi * part.covariance)[1] for part in located])
    peak = np.array([-0.5 * np.linalg.slogdet(2.0 * math.pi * sensor.covariance)[1] for sensor in sensors])
    return ScoreTerms(np.log(P / density), np.log1p(-P), np.log(P / there) - 0.5 * spread, peak, by_range)


def log_birth(covariances: Array, region: Array, birth_rate: float) -> Array:
    """Logarithm of the birth density integrated over the positions of new targets, (K,): at most ln(birth rate).

    The cost of a tuple is taken at the most likely position. A target is born anywhere in the region (3, 2) with
    density birth rate (in a scan) / volume; integrated over the position, of covariance (K, 3, 3) (Laplace's
    approximation, exact for linear sensors), the likelihood is the one at the best position times this. Along each
    axis, given the axes before it, the integral is at most the region's width: heights that nothing measures may vary
    more than the region is high. Directions in which the region has no width are left out.
    """
    return np.asarray(_log_birth(for_kernels(covariances), for_kernels(region), math.log(birth_rate)))


@njit
def _log_birth(covariances: Array, region: Array, log_rate: float) -> Array:
    result, factor, log_volume = np.zeros(covariances.shape[0]), np.zeros((3, 3)), 0.0
    for i in range(3):
        width = region[i, 1] - region[i, 0]
        log_volume += math.log(width) if width > 0.0 else 0.0
    for k in range(result.size):
        for i in range(3):
            width = region[i, 1] - region[i, 0]
            factor[i, i] = 0.0
            if not width > 0.0:
                continue
            for j in range(i + 1):
                value = covariances[k, i, j]
                for m in range(j):
                    value -= factor[i, m] * factor[j, m]
                if i == j:
                    # deviation along this axis given the axes before it
                    factor[i, i] = math.sqrt(max(value, 1e-300))
                else:
                    factor[i, j] = value / factor[j, j] if factor[j, j] > 0.0 else 0.0
            result[k] += math.log(min(math.sqrt(2.0 * math.pi) * factor[i, i], width))
        result[k] += log_rate - log_volume
    return result


def doubted_gain(score: Array, gain: Array) -> Array:
    """Gain of a scan in a hypothesis' log probability if a track may be false: ln(1 - p + p exp(gain)), (T,).

    The score before the scan is the log odds that the track is a target, with probability p. If it is false, its
    measurements are false alarms, its misses are expected, and the scan adds nothing. So a tentative track takes
    measurements that no other track needs, but does not outbid a certain one.

    D. Musicki, R. Evans, Joint integrated probabilistic data association: JIPDA, IEEE Trans. Aerospace and Electronic
    Systems 40, 2004.
    """
    odds = -score
    return np.asarray(np.logaddexp(odds, gain) - np.logaddexp(odds, 0.0))


def existence_gain(score: Array, gain: Array, seen: Array) -> Array:
    """Logarithm of a tuple's weight in joint events where its track may be false, (M,): ln(p exp(gain)) if it was seen.

    The score before the scan is the log odds of p, the probability that the track is a target; ``gain`` are detections
    and misses of a target. Only a target is seen; without a measurement the track is false or its target missed, which
    is ln(1 - p + p exp(gain)), as `doubted_gain`. So weights of joint events are proportional to their probabilities.

    D. Musicki, R. Evans, as above, equations 20 to 25.
    """
    return np.asarray(np.where(seen, gain - np.logaddexp(0.0, -score), doubted_gain(score, gain)))


def sequential_threshold(false_probability: Array, missed_probability: float = 0.0) -> Array:
    """Score at which a track is confirmed: ln((1 - beta) / alpha), the upper limit of Wald's sequential test.

    alpha is the share of false tracks that may be confirmed, beta that of true tracks that may be given up. A. Wald,
    Sequential Analysis, 1947, section 3.2.
    """
    return np.asarray(np.log((1.0 - missed_probability) / false_probability))
