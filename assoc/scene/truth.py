"""True positions of the targets of a scene, and the source of each measurement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array


def integers(value: object, what: str, length: int) -> Array:
    """Return whole numbers as a read-only int64 array (length,); errors name them ``what``."""
    array = np.asarray(value)
    if array.size == 0:
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu" or array.shape != (length,):
        raise InvalidInputError(
            f"{what} must be integers of shape ({length},), got {array.dtype} of shape {array.shape}"
        )
    array = array.astype(np.int64)
    array.setflags(write=False)
    return array


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Truth:
    """The true targets.

    Parameters
    ----------
    target_ids : sequence over scans of int arrays (T_k,)
        The targets present, each id (0 or more) once per scan.
    positions : sequence over scans of arrays (T_k, 3)
        Their positions, metres.
    sources : sequence over scans of sequences over sensors of int arrays (n,), optional
        The target that caused each measurement, or -1 for a false alarm.
    names : mapping of int to str, optional
        Names of targets, as call signs, by their ids.
    """

    target_ids: Sequence[Array]
    positions: Sequence[Array]
    sources: Sequence[Sequence[Array]] | None = None
    names: Mapping[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.target_ids) != len(self.positions):
            raise InvalidInputError(
                f"truth: target_ids has {len(self.target_ids)} scans, positions has {len(self.positions)}"
            )
        ids, positions = [], []
        for k, (targets, points) in enumerate(zip(self.target_ids, self.positions, strict=True)):
            checked = integers(targets, f"truth: target_ids of scan {k}", len(targets))
            if checked.size and (checked.min() < 0 or len(np.unique(checked)) != len(checked)):
                raise InvalidInputError(f"truth: target_ids of scan {k} must be 0 or more and different")
            ids.append(checked)
            points = np.zeros((0, 3)) if len(targets) == 0 and np.size(points) == 0 else points
            positions.append(finite_array(points, f"truth: positions of scan {k}", (len(targets), 3)))
        object.__setattr__(self, "target_ids", tuple(ids))
        object.__setattr__(self, "positions", tuple(positions))
        if self.sources is not None:
            sources = []
            for k, scan in enumerate(self.sources):
                row = [integers(s, f"truth: sources of scan {k}, sensor {i}", len(s)) for i, s in enumerate(scan)]
                if any(s.size and s.min() < -1 for s in row):
                    raise InvalidInputError(f"truth: sources of scan {k} must be target ids or -1 (false alarm)")
                sources.append(tuple(row))
            object.__setattr__(self, "sources", tuple(sources))
        for target, name in self.names.items():
            if isinstance(target, bool) or not isinstance(target, (int, np.integer)) or not isinstance(name, str):
                raise InvalidInputError(f"truth: names must be texts by target ids, got {target!r}: {name!r}")
        object.__setattr__(self, "names", {int(target): name for target, name in self.names.items()})

    def name_of(self, target: int) -> str:
        """Name of a target, or its id where it has none."""
        return self.names.get(int(target), str(int(target)))

    def part(self, scans: slice) -> Truth:
        """Return the truth of some scans."""
        sources = None if self.sources is None else self.sources[scans]
        return replace(self, target_ids=self.target_ids[scans], positions=self.positions[scans], sources=sources)

    def __repr__(self) -> str:
        targets = len({int(i) for ids in self.target_ids for i in ids})
        return f"Truth({targets} targets, {len(self.target_ids)} scans)"
