"""Tracks the slices of a recording in processes or on a cluster, and keeps those that are done."""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._cli.options import Given
from assoc._files.npz import Field, load_npz, save_npz
from assoc._files.output import STDOUT, is_stream
from assoc._system import temporary
from assoc._system.cluster import LostError
from assoc._system.engine import spread
from assoc._text.times import moment
from assoc._version import __version__
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.tracking.adapting.identity_watch import IdentityWatch
from assoc.tracking.offline.slices import Slice, SliceTracks, TrackSlice, slices_of
from assoc.tracking.track_table import COLUMNS

if TYPE_CHECKING:
    import pandas as pd

    from assoc.recordings import Window

_FORMAT, _VERSION = "assoc.slice", 2
_ARRAYS = {"ends": 1, "sizes": 1, "early": 1, "tracks": 1, "sure": 1, "known": 2}
_WHOLE = ("track_id", "hits", "parent", "hits_1", "hits_2", "sizes", "early", "tracks", "known")


@dataclass
class Slices:
    """Slices of a recording, done (in `folder`) or not."""

    folder: str
    stay: bool = True
    """Whether those that are done stay when the program ends early."""
    spans: dict[int, tuple[float, float]] = field(default_factory=dict)
    """First and last time of each, seconds."""
    failed: dict[int, str] = field(default_factory=dict)
    """Why some could not be tracked."""
    lost: str = ""
    """Why others were not."""

    def run(
        self, work: TrackSlice, windows: Iterable[Window], seconds: float, early: float, places: Mapping[str, Any]
    ) -> Generator[SliceTracks]:
        """Track the slices that are not done; after the loss of a worker those that are left, as long as that helps.

        Yields the tracks of all slices that are done, in order, each as soon as those before it are done or failed.
        """
        again, number = True, 0
        while again:
            again, self.lost = False, ""
            parts = self._left(slices_of(windows, seconds, early))
            results = spread(work, parts, ordered=False, here=True, **places)
            try:
                for result in results:
                    again = True
                    if isinstance(result, SliceTracks):
                        self._save(result)
                    else:
                        self.failed[result[0]] = result[1]
                    while number in self.spans:
                        part = self.load(number)
                        if part is not None:
                            yield part
                        elif number not in self.failed:
                            break
                        number += 1
                again = False
            except (LimitExceededError, LostError) as error:
                self.lost = str(error)
            except InvalidInputError as error:
                if not self.done() and not self.failed:
                    raise
                self.lost = str(error)
            finally:
                results.close()
        for rest in self.done():
            if rest >= number and (part := self.load(rest)) is not None:
                yield part

    def _left(self, parts: Iterator[Slice]) -> Iterator[Slice]:
        for part in parts:
            self.spans[part.number] = part.windows[part.early].times[0], part.windows[-1].times[-1]
            if part.number not in self.failed and self.load(part.number) is None:
                yield part

    def _path(self, number: int) -> str:
        return os.path.join(self.folder, f"{number:05d}.npz")

    def _save(self, part: SliceTracks) -> None:
        arrays = {name: getattr(part, name) for name in _ARRAYS}
        for name, frame in (("frame", part.frame), ("border", part.border)):
            for column in frame:
                values = frame[column].to_numpy()
                arrays[f"{name}.{column}"] = values.astype(np.str_) if column == "status" else values
        arrays["odd"] = np.array(IdentityWatch(found=part.odd).text())
        # the process that waits for all slices saves them, each for a short time: packing would hold it up
        save_npz(self._path(part.number), _FORMAT, _VERSION, arrays, packed=False)

    def load(self, number: int) -> SliceTracks | None:
        """The tracks of a slice; None if they are not there, or damaged."""
        import pandas as pd

        columns = (*COLUMNS, "latitude", "longitude", "nis", "consistent", "hits_1", "hits_2")
        fields = {name: Field(_kind(name), ndim) for name, ndim in _ARRAYS.items()} | {"odd": Field("str", 0)}
        for table in ("frame", "border"):
            fields |= {f"{table}.{name}": Field(_kind(name), 1, name in COLUMNS) for name in columns}
        if not os.path.exists(self._path(number)):
            return None
        try:
            found = load_npz(self._path(number), _FORMAT, _VERSION, fields)
            frames: list[pd.DataFrame] = []
            for table in ("frame", "border"):
                names = [name for name in columns if f"{table}.{name}" in found]
                frames.append(pd.DataFrame({name: found[f"{table}.{name}"] for name in names}))
            odd = IdentityWatch.restored(str(found["odd"])).found
        except (ValueError, TypeError):  # of this package, or columns of several lengths
            return None
        return SliceTracks(number, frames[0], frames[1], odd=odd, **{name: found[name] for name in _ARRAYS})

    def done(self) -> list[int]:
        """Numbers of the slices that are done, in order."""
        return [number for number in sorted(self.spans) if os.path.exists(self._path(number))]

    def missing(self) -> list[str]:
        """The slices that are not done, and why."""
        gone = sorted(self.spans.keys() - set(self.done()))
        return [
            f"the slice from {moment(self.spans[number][0])} to {moment(self.spans[number][1])} "
            f"({self.failed.get(number) or self.lost})"
            for number in gone
        ]


def _kind(name: str) -> str:
    if name in ("confirmed", "consistent", "sure"):
        return "bool"
    return "str" if name == "status" else "int" if name in _WHOLE else "float"


@contextmanager
def kept_slices(given: Given, files: Iterable[str]) -> Iterator[Slices]:
    """Slices in a folder beside the output, which goes when all are done; they are those of the same work alone."""
    output = given["output"]
    if output == STDOUT or is_stream(output):
        folder = tempfile.mkdtemp(prefix="assoc-slices-")
        temporary.add(folder)
        try:
            yield Slices(folder, stay=False)
        finally:
            temporary.remove(folder)
        return
    nothing = ("jobs", "scheduler", "quiet", "verbose", "check", "rates", "output")
    work = {name: value for name, value in given.items() if name not in nothing}
    states = [(os.path.basename(file), os.stat(file).st_size, os.stat(file).st_mtime_ns) for file in files]
    digest = hashlib.sha256(repr((__version__, sorted(work.items()), states)).encode()).hexdigest()[:12]
    folder = os.path.join(f"{output}.slices", digest)
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise InvalidInputError(f"{output}.slices: cannot be made ({error.strerror or error})") from None
    slices = Slices(folder)
    yield slices
    if not slices.missing():
        shutil.rmtree(f"{output}.slices", ignore_errors=True)
