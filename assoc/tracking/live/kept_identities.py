"""Which tracks kept one identity, told while their plots come; memory does not grow with the number of plots."""

from __future__ import annotations

from collections import deque

from assoc._types import Array
from assoc.metrics.plot_identity import MEMORY, majority
from assoc.tracking.identity_evidence import UNKNOWN

# a plot that has no code, or no address
_NOBODY = -1


class _Known:
    """What the plots of one track told, of codes and of addresses."""

    __slots__ = ("had", "last", "plots")

    def __init__(self) -> None:
        self.plots: tuple[deque[int], deque[int]] = deque(maxlen=MEMORY), deque(maxlen=MEMORY)
        self.had: tuple[set[int], set[int]] = set(), set()
        """What the track's identity has been since it was confirmed."""
        self.last = 0.0
        """Time of its newest plot, seconds."""

    def identities(self) -> set[int]:
        """The addresses that the track had, or its codes where it had no address."""
        codes, addresses = self.had
        return addresses or codes


class KeptIdentities:
    """How many confirmed tracks kept one identity for all their life, as `assoc.metrics.tracks_of_one_identity`.

    A track's identity is the majority of its last plots; by addresses where its plots have any, else by Mode 3/A codes.
    """

    def __init__(self) -> None:
        self._tracks: dict[int, _Known] = {}
        self._settled = [0, 0]

    def take(self, tracks: Array, confirmed: Array, times: Array, identities: Array) -> None:
        """Take note of plots in their order.

        Parameters
        ----------
        tracks : int array (n,)
            The track that took each plot, 0 if none did.
        confirmed : bool array (n,)
            Whether that track was confirmed then.
        times : array (n,)
            Seconds.
        identities : int array (n, 2)
            Mode 3/A codes and addresses, 0 where a plot has none.
        """
        if not self._tracks and not identities.any():
            return
        rows = zip(tracks.tolist(), confirmed.tolist(), times.tolist(), identities.tolist(), strict=True)
        for track, sure, time, told in rows:
            if not track:
                continue
            known = self._tracks.setdefault(track, _Known())
            known.last = max(known.last, time)
            for plots, had, one in zip(known.plots, known.had, told, strict=True):
                plots.append(_NOBODY if one == UNKNOWN else one)
                identity = majority(plots)
                if sure and identity != _NOBODY:
                    had.add(identity)

    def settle(self, living: set[int], before: float) -> None:
        """Judge the tracks that are gone and had no plot since this time (seconds), and forget them."""
        gone = [track for track, known in self._tracks.items() if track not in living and known.last < before]
        for track in gone:
            count = len(self._tracks.pop(track).identities())
            self._settled[0] += count == 1
            self._settled[1] += count > 0

    def counts(self) -> tuple[int, int]:
        """Confirmed tracks that kept one identity, and those that had any."""
        known = [len(one.identities()) for one in self._tracks.values()]
        return self._settled[0] + sum(n == 1 for n in known), self._settled[1] + sum(n > 0 for n in known)
