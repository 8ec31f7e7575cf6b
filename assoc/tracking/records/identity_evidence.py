"""Transponder codes as evidence of which track a plot belongs to.

A track's aircraft has an unknown code c, a priori uniform over N codes. A plot of it reports c with probability 1 - g,
and otherwise, garbled, any of the N codes. If n_c of the track's last n plots reported the code c, then by Bayes' rule

    w(c) = L^(n_c) / Z,    L = (1 - g + g/N) / (g/N),    Z = the sum of L^(n_c) over all N codes,

is the probability that c is the code. The likelihood of a plot's code d is (1 - g) w(d) + g/N if the plot is of the
track. If it is of something else, an aircraft that shares the code (probability s) or any other, the likelihood is
s w(d) + (1 - s)/N. The logarithm of their ratio is added to the track's score; it is 0 if plot or track has no code.

24-bit addresses are weighed in the same way, with their own probabilities. They are protected by parity and do not
change in flight: a plot with another address than the track's is outside its gate. If plot and track both have an
address, it counts alone, since the code adds no information.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from assoc._parameters import Parameters, described
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.tracking.records.track import rows_of_ids

CODES, ADDRESSES = 2**12, 2**24
"""Numbers of Mode 3/A codes and of addresses."""
_SHIPS = 1_000_000_000
LARGEST = _SHIPS + ADDRESSES - 1
"""Largest identity: ships have nine decimal digits (MMSI) in place of an address, above all addresses; see `ship`."""
UNKNOWN = 0
"""Code or address of a plot without one."""
MEMORY = 6
"""Last plots of a track that count: codes may change in flight."""
PREFIX = "identity."
"""Prefix of the names of the arrays in files."""


def ship(mmsi: int) -> int:
    """The identity of a ship: its MMSI, and 10^9 more where this could be an address (stations on shore: 00...)."""
    return mmsi if mmsi >= ADDRESSES else _SHIPS + mmsi


def address_text(number: int) -> str:
    """Six hexadecimal digits of an address, the nine decimal ones of a ship."""
    return f"{number:06x}" if number < ADDRESSES else f"{number % _SHIPS:09d}"


@dataclass(frozen=True)
class IdentityParameters(Parameters):
    """How far codes and addresses can be trusted.

    Parameters
    ----------
    code_garbled : float
        Probability that a decoded code is wrong.
    code_shared : float
        Probability that another aircraft has the same code.
    address_garbled, address_shared : float
        The same for addresses.
    """

    code_garbled: float = described(0.02, "share of Mode 3/A codes that are garbled")
    code_shared: float = described(0.01, "share of other aircraft with the same Mode 3/A code")
    address_garbled: float = described(1e-4, "share of ICAO addresses that are garbled")
    address_shared: float = described(1e-4, "share of other aircraft with the same address")

    def __post_init__(self) -> None:
        self._probability("code_garbled", "code_shared", "address_garbled", "address_shared")


class Identities(NamedTuple):
    """Identities of the last plots of tracks."""

    parameters: IdentityParameters
    ids: Array = np.zeros(0, dtype=np.int64)
    """Ids of the tracks, ascending, (K,)."""
    last: Array = np.zeros((0, MEMORY, 2), dtype=np.int64)
    """Code and address of each track's last plots, the newest first; 0 unknown; (K, MEMORY, 2)."""

    def evidence(self, track_id: Array, identities: Array) -> tuple[Array, Array]:
        """Weigh pairs of a track id (K,) and a plot's code and address (K, 2).

        Returns the log likelihood ratio of "the plot is of the track" and "of something else", (K,), finite; and bool
        (K,), False where addresses rule the pair out.
        """
        last = self._of(track_id)
        p = self.parameters
        code, _ = log_ratio(last[:, :, 0], identities[:, 0], CODES, p.code_garbled, p.code_shared)
        address, likeliest = log_ratio(last[:, :, 1], identities[:, 1], ADDRESSES, p.address_garbled, p.address_shared)
        both = (identities[:, 1] != UNKNOWN) & (likeliest != UNKNOWN)
        return np.where(both, address, code), ~both | (likeliest == identities[:, 1])

    def after(self, taken: Sequence[Array], identities: Sequence[Array], living: Array) -> Identities:
        """Add plots and their tracks (0: none), by sensor; tracks that are not in `living` are forgotten."""
        ids = np.unique(living)
        last = self._of(ids)
        for owners, pairs in zip(taken, identities, strict=True):
            for track, pair in zip(np.asarray(owners).tolist(), pairs, strict=True):
                row = int(np.searchsorted(ids, track))
                if pair.any() and row < len(ids) and ids[row] == track:
                    last[row, 1:] = last[row, :-1].copy()
                    last[row, 0] = pair
        known = last.any(axis=(1, 2))
        return Identities(self.parameters, ids[known], last[known])

    def of_tracks(self, old: Array, new: Array) -> tuple[Array, Array]:
        """Evidence, by their last plots, that new tracks (K,) are these old ones (K,); see `evidence`."""
        return self.evidence(old, self._of(new)[:, 0])

    def _of(self, track_id: Array) -> Array:
        """Codes and addresses of tracks' last plots, (K, MEMORY, 2)."""
        last = np.concatenate([self.last, np.zeros((1, MEMORY, 2), dtype=np.int64)])
        return np.asarray(last[rows_of_ids(self.ids, track_id)])

    def arrays(self) -> dict[str, Array]:
        """The state as arrays; `restored` reads it."""
        return {f"{PREFIX}ids": self.ids, f"{PREFIX}told": self.last}

    def restored(self, arrays: Mapping[str, Array]) -> Identities:
        """Read a state that `arrays` returned.

        Raises
        ------
        InvalidInputError
            The arrays do not hold such a state.
        """
        ids, last = arrays[f"{PREFIX}ids"], arrays[f"{PREFIX}told"]
        good = ids.ndim == 1 and last.shape == (len(ids), MEMORY, 2) and bool((np.diff(ids) > 0).all())
        if not good or (last < 0).any() or (last > LARGEST).any():
            raise InvalidInputError(f"the fields '{PREFIX}...' are no identities of tracks")
        return Identities(self.parameters, ids, last)


def log_ratio(last: Array, code: Array, count: int, garbled: float, shared: float) -> tuple[Array, Array]:
    """Log likelihood ratios of plots' codes, and the likeliest code of each track (0 where its plots have none).

    Parameters
    ----------
    last : int array (K, M)
        Codes of the last plots of each track, 0 unknown.
    code : int array (K,)
        Code of the plot, 0 unknown.
    count : int
        N, the number of codes.
    garbled, shared : float
        g and s; see the module's description.
    """
    known = last != UNKNOWN
    # how often each code occurs among the last plots; a code that occurs k times counts k times with weight 1/k
    times = ((last[:, :, None] == last[:, None, :]) & known[:, None, :]).sum(axis=2)
    each = np.where(known, 1.0 / np.maximum(times, 1), 0.0)
    vote = np.log1p(-garbled + garbled / count) - np.log(garbled / count)
    votes = np.where(known, times, 0)
    top = vote * votes.max(axis=1, initial=0)
    scaled = (each * np.exp(vote * votes - top[:, None])).sum(axis=1) + (count - each.sum(axis=1)) * np.exp(-top)
    same = ((last == code[:, None]) & known).sum(axis=1)
    weight = np.exp(vote * same - top) / scaled
    same_aircraft = (1.0 - garbled) * weight + garbled / count
    other = shared * weight + (1.0 - shared) / count
    informative = (code != UNKNOWN) & known.any(axis=1)
    best = np.take_along_axis(last, np.argmax(np.where(known, times, -1), axis=1)[:, None], axis=1)[:, 0]
    return np.where(informative, np.log(same_aircraft / other), 0.0), np.where(known.any(axis=1), best, UNKNOWN)


def no_identities(measurements: Sequence[Array]) -> list[Array]:
    """Unknown identities for all measurements."""
    return [np.zeros((len(z), 2), dtype=np.int64) for z in measurements]


def checked_identities(identities: Sequence[Array], sizes: Sequence[int]) -> list[Array]:
    """Codes and addresses of each sensor's measurements, int64 (n_s, 2); -1, as 0, is none.

    Raises
    ------
    InvalidInputError
        They are not whole numbers of this shape, or out of range.
    """
    found = [np.asarray(array) for array in identities]
    if len(found) != len(sizes):
        raise InvalidInputError(f"identities: expected one array for each of {len(sizes)} sensors, got {len(found)}")
    for s, (array, size) in enumerate(zip(found, sizes, strict=True)):
        if array.shape != (size, 2) or (array.size and array.dtype.kind not in "iu"):
            raise InvalidInputError(
                f"identities of sensor {s}: expected whole numbers (Mode 3/A code, address) of shape {(size, 2)}, "
                f"got {array.dtype} {array.shape}"
            )
        # some sources write the four octal digits of a code as a decimal number, up to 7777
        if array.size and not (array.min() >= -1 and array.max() <= LARGEST):
            raise InvalidInputError(f"identities of sensor {s}: expected numbers from 0 (or -1: none) to {LARGEST}")
    return [np.maximum(array.astype(np.int64), UNKNOWN) for array in found]
