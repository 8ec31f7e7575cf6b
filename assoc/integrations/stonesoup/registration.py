"""Detections without the biases of their sensors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from datetime import datetime
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.feeder.base import DetectionFeeder
from stonesoup.reader import Reader

from assoc._types import Array
from assoc.integrations.stonesoup.adapted import AdaptedSensor
from assoc.integrations.stonesoup.frame import make_frame
from assoc.integrations.stonesoup.ordering import sorted_detections
from assoc.integrations.stonesoup.scenes import by_time, region_of
from assoc.registration import OnlineRegistration, RegistrationParameters


class RegistrationFeeder(DetectionFeeder):  # type: ignore[misc]
    """Finds the biases of several sensors while they report, and takes them off their detections.

    Biases are found from the targets that the sensors see at the same times; no truth is needed. Sets are yielded as
    they come. Biases of clocks and of stated places are not found here: ``assoc.registration.register`` finds them in
    the scene that `scene_from_detections` makes of a recording.

    Attributes
    ----------
    registration : assoc.registration.OnlineRegistration
        The present ``biases`` of its ``terms``, and their ``covariance``.
    """

    reader: Reader = Property(doc="A reader, a simulator, or a feeder that merges several readers.")
    sensors: Sequence[AdaptedSensor] = Property(doc="What detects, each made by `adapt`.")
    parameters: Mapping[str, Any] = Property(
        default_factory=dict, doc="Of ``assoc.registration.RegistrationParameters``: range_spread, reference, ..."
    )
    region: Any = Property(default=None, doc="Bounds of x, y, z, shape (3, 2), as of a scene.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        frame = self._frame = make_frame(self.sensors)
        self.registration = OnlineRegistration(
            frame.sensors, region_of(frame, self.region), RegistrationParameters(**self.parameters)
        )

    @BufferedGenerator.generator_method  # type: ignore[untyped-decorator]
    def data_gen(self) -> Iterator[tuple[datetime, set[Any]]]:
        """Yield the time and the corrected detections of each set."""
        zero: datetime | None = None
        for time, sets in by_time(self.reader):
            zero = zero or time
            parts = self._frame.split(sorted_detections(d for found in sets for d in found))
            measured = self._frame.measurements(parts)
            self.registration = self.registration.after((time - zero).total_seconds(), measured)
            changes = [new - old for new, old in zip(self.registration.correct(measured), measured, strict=True)]
            corrected: dict[int, Any] = {}
            for adapted, part, change in zip(self._frame.adapted, parts, changes, strict=True):
                for detection, row in zip(part, change, strict=True):
                    corrected[id(detection)] = _changed(detection, adapted, row)
            for found in sets:
                yield time, {corrected[id(detection)] for detection in found}


def _changed(detection: Any, sensor: AdaptedSensor, change: Array) -> Any:
    """The detection with this added to its components, of which ours are in another order."""
    added = np.zeros((len(detection.state_vector), 1))
    added[list(sensor.order), 0] = change
    new = copy(detection)
    new.state_vector = detection.state_vector + added
    return new
