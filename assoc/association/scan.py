"""The association of one scan."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assoc._text.shown import Shown
from assoc._text.times import moment
from assoc.solution import Solution


@dataclass(frozen=True, eq=False, repr=False)
class ScanAssociation(Shown):
    """The association of one scan.

    Attributes
    ----------
    scan : int
        Number of the scan, from 0.
    time : float or None
        Its time stamp, seconds; None where only an assignment problem was given.
    sizes : tuple of int
        Measurements of each sensor.
    solution : Solution
        The chosen tuples with their cost and certificate.
    targets : int32 array, shape (T, S)
        The tuples that are targets: those with at least two measurements, and singletons of negative cost.
    positions : array (T, 3) or None
        Fused (maximum-likelihood) positions, metres; None without a scene.
    covariances : array (T, 3, 3) or None
        Their covariances, m^2.
    costs : array (T,) or None
        Cost of each target in the solved problem; None in associations made elsewhere.
    true_tuples : int or None
        Targets that at least two sensors detected; None where the truth is not known.
    correct_tuples : int or None
        Those of them whose measurements form exactly a chosen tuple.
    ranked : tuple of ScanAssociation
        The k best associations of the scan, this one first; empty if not requested.
    compile_time : float
        Seconds of compiling or loading kernels for this scan, costs and positions included; not part of
        ``solution.runtime``.
    probabilities : array (T, 3) or None
        Probability of each target among all associations of the scan, if requested (``assoc.marginals``), between
        itself less and plus two standard errors, which are 0 where it is exact.
    """

    scan: int
    time: float | None
    sizes: tuple[int, ...]
    solution: Solution
    targets: NDArray[np.int32]
    positions: NDArray[np.float64] | None = None
    covariances: NDArray[np.float64] | None = None
    costs: NDArray[np.float64] | None = None
    true_tuples: int | None = None
    correct_tuples: int | None = None
    ranked: tuple[ScanAssociation, ...] = ()
    compile_time: float = 0.0
    probabilities: NDArray[np.float64] | None = None

    @property
    def least_probable(self) -> float | None:
        """Probability of the target that is most in doubt; None where none is known."""
        if self.probabilities is None or not len(self.probabilities):
            return None
        return float(self.probabilities[:, 1].min())

    @property
    def false_alarms(self) -> int:
        """Number of measurements that belong to no target."""
        return sum(self.sizes) - int(np.count_nonzero(self.targets))

    def labels(self) -> tuple[NDArray[np.int64], ...]:
        """For each sensor the target (row of ``targets``) of each measurement, -1 for a false alarm."""
        result = tuple(np.full(size, -1, dtype=np.int64) for size in self.sizes)
        for sensor, label in enumerate(result):
            seen = np.flatnonzero(self.targets[:, sensor])
            label[self.targets[seen, sensor] - 1] = seen
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return the scan as in a result file (docs/results.md)."""
        solution = self.solution
        targets: list[dict[str, Any]] = [
            {"tuple": row.tolist(), "position": None, "covariance": None} for row in self.targets
        ]
        if self.positions is not None and self.covariances is not None:
            for entry, position, spread in zip(targets, self.positions, self.covariances, strict=True):
                entry.update(position=position.tolist(), covariance=spread.tolist())
        if self.probabilities is not None:
            for entry, (lower, probability, upper) in zip(targets, self.probabilities.tolist(), strict=True):
                entry.update(probability=probability, probability_lower=lower, probability_upper=upper)
        content = {
            "scan": self.scan,
            "time": self.time,
            "sizes": list(self.sizes),
            "cost": plain(solution.cost),
            "lower_bound": plain(solution.lower_bound),
            "gap": plain(solution.gap),
            "status": solution.status,
            "tuples": solution.tuples.tolist(),
            "targets": targets,
            "runtime": solution.runtime,
            "compile_time": self.compile_time,
        }
        if self.ranked:
            content["ranked"] = [{"rank": rank, **scan.to_dict()} for rank, scan in enumerate(self.ranked, start=1)]
        return content

    def __repr__(self) -> str:
        when = "" if self.time is None else f", t = {moment(self.time)}"
        return (
            f"ScanAssociation({self.scan}{when}: {' + '.join(map(str, self.sizes))} measurements, "
            f"{len(self.targets)} targets, {self.false_alarms} false alarms, {self.solution!r})"
        )


def plain(value: Any) -> Any:
    """Return a value that JSON can hold: no infinities, and text for anything but numbers and text."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, (tuple, list)):
        return [plain(entry) for entry in value]
    return str(value)
