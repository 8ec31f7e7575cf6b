"""Recorded plots for ``assoc track``: files read part by part, and their grouping into scans."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import with_others
from assoc._cli.options import Given, flag_of
from assoc._cli.track.options import RADAR
from assoc._files.reading import kind_of
from assoc.errors import InvalidInputError, warn

if TYPE_CHECKING:
    from assoc.recordings import Recording, Window
    from assoc.recordings.survey import StoredPlots

_USUAL = {
    "range_noise": "30 to 150 m are usual",
    "azimuth_noise": "0.05 to 0.2 degrees are usual",
    "rotation": "4 to 12 seconds are usual",
}


@contextmanager
def as_options() -> Iterator[None]:
    """Name in errors the options instead of the library's arguments, with usual values."""
    try:
        yield
    except InvalidInputError as error:
        text = str(error)
        if " rotation time " in text:
            text = f"rotation: {text}"
        name, _, rest = text.partition(": ")
        flags = {**{argument: flag for flag, argument in RADAR.items()}, "rotation": "rotation"}
        if name not in flags:
            raise
        usual = f" ({_USUAL[name]})" if name in _USUAL else ""
        raise InvalidInputError(f"{flag_of(flags[name])}: {rest}{usual}") from None


def stored_plots(given: Given) -> tuple[StoredPlots, Mapping[str, int], list[str]]:
    """The plots of the files, read part by part, what reading had to correct, and what could not be read."""
    import numpy as np

    from assoc.recordings.survey import StoredPlots

    files, notes = given["files"], Counter[str]()
    left: list[str] = []
    first = {}
    for file in files:
        try:
            first[file] = next(_parts(file, given, Counter())).times[0] if len(files) > 1 else 0.0
        except InvalidInputError as error:
            left.append(str(error))
    if len(left) == len(files):
        raise with_others([InvalidInputError(line) for line in left])

    def parts() -> Iterator[Recording]:
        end, behind, latest = -math.inf, "", np.zeros((0, 2))
        for file in sorted(first, key=lambda file: float(first[file])):
            before, late, last = end, 0, None
            try:
                for part in _parts(file, given, notes):
                    # a file may begin at the instant at which the one before ends, with other plots
                    twice = (part.measurements[:, None] == latest).all(axis=2).any(axis=1) & (part.times == before)
                    kept = (part.times >= before) & ~twice
                    late += len(part) - int(kept.sum())
                    if kept.any():
                        part = part.take(kept)
                        end, last = float(part.times[-1]), part
                        yield part
            except InvalidInputError as error:
                if len(files) == 1:
                    raise
                left.append(str(error))
            if late:
                left.append(f"{late} plots of {file}, which are before the end of {behind}")
            if last is not None:
                behind, latest = file, last.measurements[last.times == end]

    stored = StoredPlots(parts())
    for line in left:
        warn(f"left out: {line}")
    if given["rates"] and not stored.survey.named:
        raise InvalidInputError(f"--rates: {files[0]}: no plot has an identity (column mode3 or aircraft)")
    return stored, notes, left


def _parts(file: str, given: Given, notes: Counter[str]) -> Iterator[Recording]:
    """The plots of a file part by part; what reading had to correct is counted in the notes."""
    from assoc.recordings.reading import PlotReader

    if kind_of(file) == "asterix":
        from assoc.integrations.asterix.parts import AsterixPlots

        reader: Any = AsterixPlots(file, given["radar"], "--radar", editions=given["edition"])
    else:
        reader = PlotReader(file)
    yield from reader
    notes.update(reader.notes)


class Windows:
    """The plots, grouped into scans, one after the other."""

    def __init__(self, stored: StoredPlots, given: Given, seed: int) -> None:
        from assoc.recordings import estimate_rotation

        self._stored, self._kind, self._seed = stored, given["window"], seed
        self.rotation = given["rotation"] or 1.0
        if self._kind in ("ctw", "ctw-time"):
            self.rotation = given["rotation"] or estimate_rotation(stored)

    def __iter__(self) -> Iterator[Window]:
        import numpy as np

        from assoc.recordings import Window, irregular_groups
        from assoc.recordings.recording import joined
        from assoc.recordings.windows import windows_in_turn

        if self._kind == "none":
            begin = 0
            for part in self._stored:
                for row in range(len(part)):
                    window = Window.of(part, np.array([row]), begin + row)
                    yield replace(window, rows=window.rows + begin)
                begin += len(part)
        elif self._kind == "irregular":
            yield from irregular_groups(joined([*self._stored], {}, ""), np.random.default_rng(self._seed))
        else:
            by: Any = "antenna" if self._kind == "ctw" else "time"
            yield from windows_in_turn(self._stored, self._stored.survey, self.rotation, by=by)
