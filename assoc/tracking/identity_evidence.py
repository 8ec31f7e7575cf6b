"""Transponder codes as evidence of which track a plot belongs to.

A track's aircraft has an unknown code c, a priori each of N with the same probability. A plot of it tells c with
probability 1 - g and any of the N codes, garbled, else. Of the n plots that the track has taken lately n_c told the
code c, so that by Bayes' rule

    w(c) = L^(n_c) / Z,    L = (1 - g + g/N) / (g/N),    Z = the sum of L^(n_c) over all N codes,

is the probability that c is the code. A plot with the code d is then (1 - g) w(d) + g/N likely if it is of the track.
If it is of something else, an aircraft that shares the code (probability s) or any other, it is s w(d) + (1 - s)/N
likely. The logarithm of the ratio of the two joins the track's score. A plot without a code, or a track without one,
says nothing.

The same holds of the addresses of 24 bits with probabilities of their own. They are protected by parity and do not
change in flight: what tells another address than that which the track has by its plots is not in its gate. Where both
address and code of plot and track are known, the address counts alone, since the code tells nothing more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from assoc._parameters import Parameters
from assoc._types import Array
from assoc.errors import InvalidInputError

CODES, ADDRESSES = 2**12, 2**24
"""Mode 3/A codes, and addresses."""
UNKNOWN = 0
"""Of a code and of an address."""
MEMORY = 6
"""Plots of a track whose codes count: a code may be changed in flight."""
PREFIX = "identity."
"""Of the names of the arrays."""


@dataclass(frozen=True)
class IdentityParameters(Parameters):
    """How far codes and addresses are to be trusted.

    Parameters
    ----------
    code_garbled : float
        Probability that a code that was decoded is not the aircraft's.
    code_shared : float
        Probability that another aircraft, whose plot this might be, has the same code.
    address_garbled, address_shared : float
        The same of addresses.
    """

    code_garbled: float = field(default=0.02, metadata={"help": "share of Mode 3/A codes that are garbled"})
    code_shared: float = field(default=0.01, metadata={"help": "share of other aircraft with the same Mode 3/A code"})
    address_garbled: float = field(default=1e-4, metadata={"help": "share of ICAO addresses that are garbled"})
    address_shared: float = field(default=1e-4, metadata={"help": "share of other aircraft with the same address"})

    def __post_init__(self) -> None:
        self._probability("code_garbled", "code_shared", "address_garbled", "address_shared")


class Evidence(NamedTuple):
    """What identities say of K pairs of a track and a plot."""

    log_ratio: Array
    """"The plot is of the track" against "of something else", (K,); finite."""
    possible: Array
    """Whether the pair is not ruled out by addresses, bool (K,)."""


class Identities(NamedTuple):
    """The identities that tracks have had lately."""

    parameters: IdentityParameters
    ids: Array = np.zeros(0, dtype=np.int64)
    """Tracks, ascending."""
    told: Array = np.zeros((0, MEMORY, 2), dtype=np.int64)
    """Code and address of each one's last plots, the newest first; 0 unknown."""

    def evidence(self, track_id: Array, identities: Array) -> Evidence:
        """Weigh pairs of a track (K,) and the code and address of a plot (K, 2)."""
        told = self._of(track_id)
        p = self.parameters
        code, _ = log_ratio(told[:, :, 0], identities[:, 0], CODES, p.code_garbled, p.code_shared)
        address, own = log_ratio(told[:, :, 1], identities[:, 1], ADDRESSES, p.address_garbled, p.address_shared)
        both = (identities[:, 1] != UNKNOWN) & (own != UNKNOWN)
        return Evidence(np.where(both, address, code), ~both | (own == identities[:, 1]))

    def after(self, taken: Sequence[Array], identities: Sequence[Array], living: Array) -> Identities:
        """Identities once the tracks (0: none) have taken these plots, sequences over sensors; others are forgotten."""
        ids = np.unique(living)
        told = self._of(ids)
        for owners, own in zip(taken, identities, strict=True):
            for track, pair in zip(np.asarray(owners).tolist(), own, strict=True):
                row = int(np.searchsorted(ids, track))
                if pair.any() and row < len(ids) and ids[row] == track:
                    told[row, 1:] = told[row, :-1].copy()
                    told[row, 0] = pair
        known = told.any(axis=(1, 2))
        return Identities(self.parameters, ids[known], told[known])

    def _of(self, track_id: Array) -> Array:
        """What the plots of tracks told, (K, MEMORY, 2)."""
        rows = np.searchsorted(self.ids, track_id)
        found = np.append(self.ids, -1)[rows] == track_id
        told = np.concatenate([self.told, np.zeros((1, MEMORY, 2), dtype=np.int64)])
        return told[np.where(found, rows, len(self.ids))]

    def arrays(self) -> dict[str, Array]:
        """The state as arrays; `restored` reads it."""
        return {f"{PREFIX}ids": self.ids, f"{PREFIX}told": self.told}

    def restored(self, arrays: Mapping[str, Array]) -> Identities:
        """Take over a state that `arrays` has given.

        Raises
        ------
        InvalidInputError
            The arrays are of no such state.
        """
        ids, told = arrays[f"{PREFIX}ids"], arrays[f"{PREFIX}told"]
        good = ids.ndim == 1 and told.shape == (len(ids), MEMORY, 2) and bool((np.diff(ids) > 0).all())
        if not good or (told < 0).any() or (told >= ADDRESSES).any():
            raise InvalidInputError(f"the fields '{PREFIX}...' are no identities of tracks")
        return Identities(self.parameters, ids, told)


def log_ratio(told: Array, given: Array, count: int, garbled: float, shared: float) -> tuple[Array, Array]:
    """Log likelihood ratio of plots' codes, and the likeliest code of each track (0 where it told none).

    Parameters
    ----------
    told : int array (K, M)
        Codes that the last plots of each track told, 0 unknown.
    given : int array (K,)
        Code of the plot, 0 unknown.
    count : int
        N, how many codes there are.
    garbled, shared : float
        g and s; see the module's description.
    """
    known = told != UNKNOWN
    # how often each of the codes was told; a code told k times is there k times, each with a k-th of its weight
    times = ((told[:, :, None] == told[:, None, :]) & known[:, None, :]).sum(axis=2)
    each = np.where(known, 1.0 / np.maximum(times, 1), 0.0)
    vote = np.log1p(-garbled + garbled / count) - np.log(garbled / count)
    votes = np.where(known, times, 0)
    top = vote * votes.max(axis=1, initial=0)
    scaled = (each * np.exp(vote * votes - top[:, None])).sum(axis=1) + (count - each.sum(axis=1)) * np.exp(-top)
    same = ((told == given[:, None]) & known).sum(axis=1)
    weight = np.exp(vote * same - top) / scaled
    own = (1.0 - garbled) * weight + garbled / count
    other = shared * weight + (1.0 - shared) / count
    says = (given != UNKNOWN) & known.any(axis=1)
    best = np.take_along_axis(told, np.argmax(np.where(known, times, -1), axis=1)[:, None], axis=1)[:, 0]
    return np.where(says, np.log(own / other), 0.0), np.where(known.any(axis=1), best, UNKNOWN)


def no_identities(measurements: Sequence[Array]) -> list[Array]:
    """Identities of measurements, none of which has any."""
    return [np.zeros((len(z), 2), dtype=np.int64) for z in measurements]


def checked_identities(identities: Sequence[Array], sizes: Sequence[int]) -> list[Array]:
    """Codes and addresses of each sensor's measurements, int64 (n_s, 2).

    Raises
    ------
    InvalidInputError
        They are not whole numbers of this shape, or out of range.
    """
    found = [np.asarray(one) for one in identities]
    if len(found) != len(sizes):
        raise InvalidInputError(f"identities: expected one array for each of {len(sizes)} sensors, got {len(found)}")
    for s, (one, size) in enumerate(zip(found, sizes, strict=True)):
        if one.shape != (size, 2) or (one.size and one.dtype.kind not in "iu"):
            raise InvalidInputError(
                f"identities of sensor {s}: expected whole numbers (Mode 3/A code, address) of shape {(size, 2)}, "
                f"got {one.dtype} {one.shape}"
            )
        # codes are also written with their four octal digits as a decimal number, so up to 7777
        if one.size and not (one.min() >= 0 and one.max() < ADDRESSES):
            raise InvalidInputError(f"identities of sensor {s}: expected numbers from 0 to {ADDRESSES - 1}")
    return [one.astype(np.int64) for one in found]
