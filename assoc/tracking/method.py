"""How a kind of tracker associates a scan with its tracks; all other stages of a step are in `assoc.tracking.step`.

A method is a frozen dataclass of the settings of this kind of tracker. Its functions take a step under way, return
records and have no side effects. A tracker that decides each scan at once defines `associate`; the defaults of the
other functions suit it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scan import Scan
from assoc.tracking.file import Saved
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track import Decision, Step, decision
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import new_targets_at
from assoc.tracking.stages.ending import to_delete
from assoc.tracking.state import TrackerState


@dataclass(frozen=True)
class Method(ABC):
    """The method of association of a kind of tracker."""

    starter: ClassVar[Method | None] = None
    """Method of the starter where all sensors measure angles alone; see `assoc.tracking.stages.starter`."""

    def arranged(self, scan: Scan) -> Scan:
        """The scan with its measurements in the order in which the method numbers them."""
        return scan

    own_times: ClassVar[bool] = True
    """Whether it takes measurements with times of their own (`Progress.timed`), sectors and identities."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for old in ("at_once", "in_order"):
            if old in vars(cls):
                raise InvalidInputError(
                    f"{cls.__name__}.{old}: a method of association defines associate(progress) instead; "
                    "progress.timed is None in a scan of one instant"
                )

    @abstractmethod
    def associate(self, progress: Progress) -> Association:
        """Associate a scan with the tracks, update these, and begin new ones.

        Tracks have been predicted to a scan of one instant. If measurements have times of their own, they are those of
        the last scan, and `progress.timed` predicts. `assoc.tracking.growth` (sensor by sensor) and
        `assoc.tracking.associate.all_sensors` (all sensors together) do both.
        """

    def life_cycle(self, progress: Progress, association: Association) -> Progress:
        """Confirm tracks, report decisions, delete tracks."""
        settings, scan = progress.settings, progress.scan
        tracks = association.tracks.confirm(settings.life_cycle, new_targets_at(progress, association.tracks))
        now = decision(scan.index, scan.time, association.assigned, tracks.track_id[tracks.confirmed])
        gone = to_delete(progress, tracks)
        kept = tracks[~gone] if gone.any() else tracks
        ended = np.sort(tracks.track_id[gone & tracks.confirmed])
        step = Step(now.scan, now.time, now.assigned, now.confirmed, final=(now,), ended=ended)
        return progress.with_state(tracks=kept, method_state=association.method_state)._replace(step=step)

    def detected(self, state: TrackerState, step: Step) -> Array:
        """Probability with which each sensor has detected each track in a step, (T, S)."""
        return np.stack([np.isin(state.tracks.track_id, ids) for ids in step.assigned], axis=1).astype(np.float64)

    def renamed(self, state: TrackerState, ids: Array, names: Array) -> TrackerState:
        """The state with these names (K,) in place of ids (K,); tracks that had these names end."""
        tracks = state.tracks[~np.isin(state.tracks.track_id, names)].renamed(ids, names)
        return state._replace(tracks=tracks[np.argsort(tracks.track_id, kind="stable")])

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> Any:
        """The method's own part of the state before the first scan, with tracks that are known."""
        return None

    def current(self, state: TrackerState) -> TrackBatch:
        """The tracks that users see."""
        return state.tracks

    def open_decisions(self, state: TrackerState) -> tuple[Decision, ...]:
        """Present decisions about the scans that are not final yet, oldest first."""
        return ()

    def arrays(self, method_state: Any) -> Mapping[str, Array]:
        """The method's own part of a state as arrays for a file."""
        return {} if method_state is None else method_state._asdict()

    def restored(self, settings: TrackerSettings, saved: Saved, state: TrackerState) -> Any:
        """The method's own part of a state read from a file, checked; `state` is the rest."""
        return self.begun(settings, state.tracks)
