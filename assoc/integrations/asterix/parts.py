"""The plots of an ASTERIX file part by part."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping

from assoc.errors import InvalidInputError
from assoc.integrations.asterix.reading import Decoded, Source
from assoc.recordings.cleaning import Cleaning
from assoc.recordings.recording import Recording


class AsterixPlots:
    """The plots of one radar in a file in parts, in the order of time, so that memory grows by the file's bytes alone.

    `radar` is its SAC/SIC, needed if the file has plots of several; errors name the `label`, which gave it. `editions`
    are as for `read_asterix`. A part has about `at_once` plots. `notes` are those of `AsterixContent`, and plots that
    came too late; complete after the last part.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        radar: str | None = None,
        label: str = "radar",
        *,
        editions: Mapping[int, str] | None = None,
        at_once: int = 50_000,
    ) -> None:
        self._path, self._radar, self._label, self._at_once = path, radar, label, at_once
        self._editions = editions
        self.notes: Mapping[str, int] = {}

    def __iter__(self) -> Iterator[Recording]:
        read, name = Decoded(self._path, self._editions), os.path.basename(os.fspath(self._path))
        self.notes = read.notes
        clean = Cleaning(name, read.notes, clock=True)
        for _ in read.blocks():
            for source, clock in read.plots.items():
                if self._radar not in (None, _name(source)) or len(read.plots) > 1 and self._radar is None:
                    clock.rows = []
                elif len(clock.rows) >= self._at_once:
                    yield from clean.take(clock.taken())
        read.check()
        chosen = chosen_radar(self._path, read.plots, self._radar, self._label)
        yield from clean.take(read.plots[chosen].taken(), last=True)


def chosen_radar(path: str | os.PathLike[str], plots: Iterable[Source], radar: str | None, label: str) -> Source:
    """The radar of a file whose plots are wanted: the only one, or that named SAC/SIC."""
    known = {_name(source): source for source in sorted(plots)}
    if not known:
        raise InvalidInputError(
            f"{os.fspath(path)}: holds no plots (categories 001, 010, 020, 048); reports of 021, and positions of 010 "
            "and 020, go into [[reports]] of radars.toml"
        )
    if radar not in known and (radar is not None or len(known) > 1):
        raise InvalidInputError(f"{label}: the file holds plots of {', '.join(known)}; name one")
    return known[radar or next(iter(known))]


def _name(source: Source) -> str:
    return f"{source[0]}/{source[1]}"
