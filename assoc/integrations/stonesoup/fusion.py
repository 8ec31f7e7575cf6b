"""Detections of several sensors fused into one set by S-D assignment."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from ordered_set import OrderedSet
from stonesoup.base import Property
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.feeder.base import DetectionFeeder
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.reader import Reader
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.detection import Detection

from assoc.association.scan import ScanAssociation
from assoc.association.solving import ScanOptions, associate_scan
from assoc.integrations.stonesoup.adapted import AdaptedSensor
from assoc.integrations.stonesoup.frame import Frame, make_frame
from assoc.integrations.stonesoup.ordering import sorted_detections
from assoc.integrations.stonesoup.scenes import by_time, region_of
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene


class FusionFeeder(DetectionFeeder):  # type: ignore[misc]
    """Fuse simultaneous detections of several sensors into one detection for each target.

    Each scan is an S-D assignment problem over the sensors. Its targets become detections: the fused position, a
    ``LinearGaussian`` measurement model with the covariance of that position, and metadata

    * ``sources``: the fused detections, one or None for each sensor,
    * ``tuple``: their 1-based numbers in the sorted scan, 0 where the sensor missed the target,
    * ``gap``: how far the scan's association can be from optimal.

    Detections that are associated as false alarms are dropped. Sets with the same time are one scan; sensors that
    report at different times are not fused.

    Attributes
    ----------
    association : ScanAssociation or None
        Association of the scan yielded last.
    """

    reader: Reader = Property(doc="A reader, a simulator, or a feeder that merges several readers.")
    sensors: Sequence[AdaptedSensor] = Property(doc="What detects, each made by `adapt`.")
    solver: str = Property(default="exact", doc="One of ``assoc.solvers.names()``.")
    parameters: Mapping[str, Any] = Property(default_factory=dict, doc="Parameters of the solver.")
    seed: int = Property(default=0, doc="The same seed gives the same fusion.")
    time_limit: float = Property(default=None, doc="Seconds for each scan.")
    gating: Mapping[str, Any] = Property(
        default_factory=dict, doc="Options of ``assoc.build_problem``, gate_probability for one."
    )
    region: Any = Property(default=None, doc="Bounds of x, y, z, shape (3, 2), as of a scene.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.association: ScanAssociation | None = None
        self._frame = make_frame(self.sensors)
        nothing = [np.zeros((0, sensor.dim)) for sensor in self._frame.sensors]
        self._scene = Scene(self._frame.sensors, np.zeros(1), [nothing], region=region_of(self._frame, self.region))
        self._options = ScanOptions(self.solver, self.seed, self.time_limit, self.parameters, self.gating)

    @BufferedGenerator.generator_method  # type: ignore[untyped-decorator]
    def data_gen(self) -> Iterator[tuple[datetime, OrderedSet[Detection]]]:
        """Yield the time and the fused detections of each scan."""
        zero: datetime | None = None
        for k, (time, sets) in enumerate(by_time(self.reader)):
            zero = zero or time
            parts = self._frame.split(sorted_detections(d for found in sets for d in found))
            scan = Scan(k, (time - zero).total_seconds(), self._frame.measurements(parts))
            self.association = associate_scan(self._scene, scan, self._options)
            yield time, OrderedSet(_fused(self._frame, parts, self.association, time))


def _fused(
    frame: Frame, parts: Sequence[Sequence[Any]], association: ScanAssociation, time: datetime
) -> Iterator[Detection]:
    """One detection for each target of a scan."""
    assert association.positions is not None and association.covariances is not None
    d = len(frame.mapping)
    rows = zip(association.targets.tolist(), association.positions, association.covariances, strict=True)
    for chosen, position, covariance in rows:
        sources = [part[i - 1] if i else None for part, i in zip(parts, chosen, strict=True)]
        model = LinearGaussian(
            ndim_state=frame.ndim_state, mapping=frame.mapping, noise_covar=CovarianceMatrix(covariance[:d, :d])
        )
        metadata = {"sources": tuple(sources), "tuple": tuple(chosen), "gap": association.solution.gap}
        yield Detection(StateVector(position[:d]), timestamp=time, measurement_model=model, metadata=metadata)
