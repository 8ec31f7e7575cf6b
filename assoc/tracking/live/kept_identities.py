"""Count tracks that kept one identity, while plots arrive; memory does not grow with the number of plots."""

from __future__ import annotations

from collections import deque

from assoc._types import Array
from assoc.metrics.plot_identity import MEMORY, majority
from assoc.tracking.records.identity_evidence import UNKNOWN, address_text

# code or address of a plot that has none
_NOBODY = -1


class _Known:
    """Codes and addresses of one track's plots."""

    __slots__ = ("had", "last", "plots")

    def __init__(self) -> None:
        self.plots: tuple[deque[int], deque[int]] = deque(maxlen=MEMORY), deque(maxlen=MEMORY)
        self.had: tuple[set[int], set[int]] = set(), set()
        """Identities of the track since it was confirmed: codes, addresses."""
        self.last = 0.0
        """Time of its newest plot, seconds."""

    def identities(self) -> set[int]:
        """Addresses of the track, or its codes if it had no address."""
        codes, addresses = self.had
        return addresses or codes


class KeptIdentities:
    """Count confirmed tracks that kept one identity all their life, like `assoc.metrics.tracks_of_one_identity`.

    A track's identity is the majority of its last plots; by addresses where its plots have any, else by Mode 3/A codes.
    """

    def __init__(self) -> None:
        self._tracks: dict[int, _Known] = {}
        self._settled = [0, 0]

    def take(self, tracks: Array, confirmed: Array, times: Array, identities: Array) -> None:
        """Record n plots, in time order.

        The track that took each, 0 if none did, and whether it was confirmed then; times, seconds; Mode 3/A codes and
        addresses (n, 2), 0 where a plot has none.
        """
        if not self._tracks and not identities.any():
            return
        rows = zip(tracks.tolist(), confirmed.tolist(), times.tolist(), identities.tolist(), strict=True)
        for track, sure, time, identity in rows:
            if not track:
                continue
            known = self._tracks.setdefault(track, _Known())
            known.last = max(known.last, time)
            for plots, had, number in zip(known.plots, known.had, identity, strict=True):
                plots.append(_NOBODY if number == UNKNOWN else number)
                most = majority(plots)
                if sure and most != _NOBODY:
                    had.add(most)

    def name_of(self, track: int) -> str:
        """The four digits of a track's code, else its address, by the majority of its last plots; "" if not known."""
        known = self._tracks.get(track)
        if known is None:
            return ""
        code, address = (majority(plots) if plots else _NOBODY for plots in known.plots)
        if code != _NOBODY:
            return f"{code:04d}"
        return "" if address == _NOBODY else address_text(address)

    def settle(self, living: set[int], before: float) -> None:
        """Count and forget the tracks that no longer live and had no plot since `before` (seconds)."""
        gone = [track for track, known in self._tracks.items() if track not in living and known.last < before]
        for track in gone:
            count = len(self._tracks.pop(track).identities())
            self._settled[0] += count == 1
            self._settled[1] += count > 0

    def counts(self) -> tuple[int, int]:
        """Number of confirmed tracks that kept one identity, and of those that had any."""
        known = [len(track.identities()) for track in self._tracks.values()]
        return self._settled[0] + sum(n == 1 for n in known), self._settled[1] + sum(n > 0 for n in known)
