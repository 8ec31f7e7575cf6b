"""From solutions back to the world: what is a target, where it is, and what is a false alarm."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assoc._system.interrupts import interruptible
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.solution import Solution

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "assoc.result"
VERSION = 1

_SHOWN = 10


@dataclass(frozen=True, eq=False, repr=False)
class ScanAssociation:
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
    true_tuples : int or None
        Targets that at least two sensors detected; None where the truth is not known.
    correct_tuples : int or None
        Those of them whose measurements, all of them and no other, form a chosen tuple.
    ranked : tuple of ScanAssociation
        The k best associations of the scan, this one first; empty where they were not asked for.
    """

    scan: int
    time: float | None
    sizes: tuple[int, ...]
    solution: Solution
    targets: NDArray[np.int32]
    positions: NDArray[np.float64] | None = None
    covariances: NDArray[np.float64] | None = None
    true_tuples: int | None = None
    correct_tuples: int | None = None
    ranked: tuple[ScanAssociation, ...] = ()

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
        """Return the scan as it stands in a result file (docs/results.md)."""
        solution = self.solution
        targets: list[dict[str, Any]] = [
            {"tuple": row.tolist(), "position": None, "covariance": None} for row in self.targets
        ]
        if self.positions is not None and self.covariances is not None:
            for entry, place, spread in zip(targets, self.positions, self.covariances, strict=True):
                entry.update(position=place.tolist(), covariance=spread.tolist())
        content = {
            "scan": self.scan,
            "time": self.time,
            "sizes": list(self.sizes),
            "cost": _plain(solution.cost),
            "lower_bound": _plain(solution.lower_bound),
            "gap": _plain(solution.gap),
            "status": solution.status,
            "tuples": solution.tuples.tolist(),
            "targets": targets,
            "runtime": solution.runtime,
        }
        if self.ranked:
            content["ranked"] = [
                {"rank": place, **one.to_dict()} for place, one in enumerate(self.ranked, start=1)
            ]
        return content

    def __repr__(self) -> str:
        when = "" if self.time is None else f", t = {self.time:g} s"
        return (
            f"ScanAssociation({self.scan}{when}: {' + '.join(map(str, self.sizes))} measurements, "
            f"{len(self.targets)} targets, {self.false_alarms} false alarms, {self.solution!r})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Association:
    """The associations of all scans of a scene.

    Attributes
    ----------
    scans : tuple of ScanAssociation
    solver : str
    parameters : mapping
        All parameters of the solver.
    seed : int
    """

    scans: tuple[ScanAssociation, ...]
    solver: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0

    @property
    def solutions(self) -> list[Solution]:
        """The solution of each scan."""
        return [scan.solution for scan in self.scans]

    def totals(self) -> dict[str, Any]:
        """Sums over the scans: number of scans, of targets found, costs, bounds, and solver seconds.

        ``optimal`` counts the scans whose status is "optimal"; ``true_tuples``, ``correct_tuples`` and
        their ratio ``share_correct`` are over the scans with known truth, None where there is none.
        """
        solutions = self.solutions
        known = [scan for scan in self.scans if scan.true_tuples is not None]
        true = sum(scan.true_tuples or 0 for scan in known) if known else None
        correct = sum(scan.correct_tuples or 0 for scan in known) if known else None
        return {
            "scans": len(self.scans),
            "measurements": sum(sum(scan.sizes) for scan in self.scans),
            "targets": sum(len(scan.targets) for scan in self.scans),
            "false_alarms": sum(scan.false_alarms for scan in self.scans),
            "cost": math.fsum(solution.cost for solution in solutions),
            "lower_bound": _plain(math.fsum(solution.lower_bound for solution in solutions)),
            "gap": _plain(math.fsum(solution.gap for solution in solutions)),
            "optimal": sum(solution.status == "optimal" for solution in solutions),
            "runtime": math.fsum(solution.runtime for solution in solutions),
            "true_tuples": true,
            "correct_tuples": correct,
            "share_correct": correct / true if true and correct is not None else None,
        }

    def summary(self) -> str:
        """Say in a few lines what was found, at what cost, and how far from optimal that can be."""
        total = self.totals()
        median = 1e3 * float(np.median([s.runtime for s in self.solutions])) if self.scans else 0.0
        lines = [
            f"{total['scans']} scans, {total['measurements']} measurements: "
            f"{total['targets']} targets, {total['false_alarms']} false alarms",
            f"cost {total['cost']:.6g}, lower bound {_text(total['lower_bound'])}, gap {_text(total['gap'])}",
            f"{self.solver}: {total['optimal']} of {total['scans']} scans certified optimal, "
            f"median {median:.3g} ms a scan",
        ]
        if total["share_correct"] is not None:
            lines.append(
                f"{total['correct_tuples']} of {total['true_tuples']} true tuples correct "
                f"({100 * total['share_correct']:.1f} %)"
            )
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """One row for each target of each scan.

        Columns: ``scan``, ``time``, ``target`` (its number within the scan), ``sensor_1`` .. ``sensor_S``
        (the measurement of each sensor, 0: missed), ``x``, ``y``, ``z`` and standard deviations ``sigma_x``,
        ``sigma_y``, ``sigma_z`` in metres (NaN without a scene).
        """
        import pandas as pd

        count = max((len(scan.sizes) for scan in self.scans), default=0)
        names = [f"sensor_{s + 1}" for s in range(count)]
        names += ["x", "y", "z", "sigma_x", "sigma_y", "sigma_z"]
        parts = []
        for scan in self.scans:
            number = len(scan.targets)
            place, sigma = np.full((number, 3), np.nan), np.full((number, 3), np.nan)
            if scan.positions is not None and scan.covariances is not None:
                place, sigma = scan.positions, np.sqrt(np.diagonal(scan.covariances, axis1=1, axis2=2))
            part = pd.DataFrame({"scan": scan.scan, "time": scan.time, "target": np.arange(number)})
            values = [
                *scan.targets.T,
                *[np.zeros(number, np.int32)] * (count - len(scan.sizes)),
                *place.T,
                *sigma.T,
            ]
            parts.append(part.assign(**dict(zip(names, values, strict=True))))
        if not parts:
            return pd.DataFrame(columns=["scan", "time", "target", *names])
        return pd.concat(parts, ignore_index=True)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a result file (docs/results.md)."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "solver": self.solver,
            "parameters": {name: _plain(value) for name, value in self.parameters.items()},
            "seed": self.seed,
            "scans": [scan.to_dict() for scan in self.scans],
            "totals": self.totals(),
        }

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the result as JSON of format "assoc.result", version 1; whole or not at all.

        Raises
        ------
        InvalidInputError
            The file cannot be written.
        """
        write_json(path, self.to_dict())

    def __repr__(self) -> str:
        total = self.totals()
        return (
            f"Association({self.solver}: {total['scans']} scans, {total['targets']} targets, "
            f"cost {total['cost']:.6g}, gap {_text(total['gap'])})"
        )

    def _repr_html_(self) -> str:
        """Return what notebooks show: the summary, and one row for each of the first scans."""
        from assoc._cli.table import rows
        from assoc._text.html import escape, table

        headers, cells = rows(self.scans[:_SHOWN], [""] * min(len(self.scans), _SHOWN))
        lines = "<br>".join(escape(line) for line in self.summary().splitlines())
        numbers = [column for column, header in enumerate(headers) if header != "status"]
        rest = len(self.scans) - _SHOWN
        more = f"<p>... and {rest} more scans</p>" if rest > 0 else ""
        return f"<p>{lines}</p>{table(headers, cells, numbers=numbers)}{more}"


@interruptible()
def associate(
    scene: Scene,
    solver: str = "exact",
    *,
    seed: int = 0,
    time_limit: float | None = None,
    jobs: int = 1,
    gating: Mapping[str, Any] | None = None,
    **parameters: Any,
) -> Association:
    """Find out for every scan which measurements are one target, and which are false alarms.

    Parameters
    ----------
    scene : Scene
    solver : str, default "exact"
        One of ``assoc.solvers.names()``.
    seed : int, default 0
        The same seed gives the same associations, whatever the number of processes.
    time_limit : float, optional
        Seconds for each scan; when they are over the best solution found is taken.
    jobs : int, default 1
        Number of processes. A script that asks for more than one must guard its own start by
        ``if __name__ == "__main__"``, because the processes are spawned.
    gating : mapping, optional
        Options of ``assoc.build_problem``: ``gate_probability``, ``max_tuples``.
    **parameters
        Parameters of the solver (``assoc.solvers.parameters(solver)``).

    Returns
    -------
    Association

    Raises
    ------
    InvalidInputError
        An argument is not as described.
    LimitExceededError
        A scan has too many candidate tuples.
    """
    from assoc.association.plan import Plan

    if not isinstance(scene, Scene):
        raise InvalidInputError(f"scene: expected a Scene, got {type(scene).__name__}")
    plan = Plan((scene,), solver, seed, time_limit, parameters, gating or {})
    return plan.gather(plan.run(plan.items(), jobs))


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Write plain data as JSON; the file appears whole or not at all."""
    from assoc._files.output import write_text

    text = json.dumps(content, allow_nan=False) + "\n"
    write_text(path, text)


def _plain(value: Any) -> Any:
    """Return what JSON can hold: no infinities, and names of what is neither number nor text."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, (tuple, list)):
        return [_plain(one) for one in value]
    return str(value)


def _text(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.6g}"
