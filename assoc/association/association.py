"""The result of an association: targets, their positions, false alarms, cost and gap."""

from __future__ import annotations

import math
import os
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_json
from assoc._text.html import escape, table
from assoc.association.scan import ScanAssociation, plain
from assoc.association.table import rows
from assoc.solution import Solution

if TYPE_CHECKING:
    import pandas as pd

FORMAT = "assoc.result"
VERSION = 1

_SHOWN = 10
# seconds of compiling that the summary mentions
_WORTH_A_LINE = 0.1


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
        """Sums over the scans; see `Totals.sums`."""
        return Totals(self.scans).sums()

    def summary(self) -> str:
        """Return the results in a few lines: targets, cost, and gap to the optimum."""
        return Totals(self.scans).summary(self.solver)

    def to_frame(self) -> pd.DataFrame:
        """One row for each target of each scan.

        Columns: ``scan``, ``time``, ``target`` (its number within the scan), ``sensor_1`` .. ``sensor_S``
        (the measurement of each sensor, 0: missed), ``x``, ``y``, ``z`` and standard deviations ``sigma_x``,
        ``sigma_y``, ``sigma_z`` in metres (NaN without a scene); where they were asked for, ``probability``,
        ``probability_lower`` and ``probability_upper``.
        """
        import pandas as pd

        count = max((len(scan.sizes) for scan in self.scans), default=0)
        names = [f"sensor_{s + 1}" for s in range(count)]
        names += ["x", "y", "z", "sigma_x", "sigma_y", "sigma_z"]
        parts = [frame_of_scan(scan, count) for scan in self.scans]
        if not parts:
            return pd.DataFrame(columns=["scan", "time", "target", *names])
        return pd.concat(parts, ignore_index=True)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a result file (docs/results.md)."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "solver": self.solver,
            "parameters": {name: plain(value) for name, value in self.parameters.items()},
            "seed": self.seed,
            "scans": [scan.to_dict() for scan in self.scans],
            "totals": self.totals(),
        }

    def to_json(self, path: str | os.PathLike[str]) -> None:
        """Write the result as JSON of format "assoc.result", version 1; atomically.

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
        """HTML for notebooks: the summary, and one row for each of the first scans."""
        headers, cells = rows(self.scans[:_SHOWN], [""] * min(len(self.scans), _SHOWN))
        lines = "<br>".join(escape(line) for line in self.summary().splitlines())
        numbers = [column for column, header in enumerate(headers) if header != "status"]
        rest = len(self.scans) - _SHOWN
        more = f"<p>... and {rest} more scans</p>" if rest > 0 else ""
        return f"<p>{lines}</p>{table(headers, cells, numbers=numbers)}{more}"


class Totals:
    """Sums over scans that are added one after the other and not kept."""

    def __init__(self, scans: Iterable[ScanAssociation] = ()) -> None:
        self._sums = dict.fromkeys(("scans", "measurements", "targets", "false_alarms", "optimal"), 0)
        self._true = self._correct = self._known = 0
        # all values: sums of them are exact
        self._values = {name: array("d") for name in ("cost", "lower_bound", "gap", "runtime", "compile_time")}
        for scan in scans:
            self.add(scan)

    def add(self, scan: ScanAssociation) -> None:
        """Add a scan."""
        solution = scan.solution
        counts = 1, sum(scan.sizes), len(scan.targets), scan.false_alarms, solution.status == "optimal"
        for name, count in zip(self._sums, counts, strict=True):
            self._sums[name] += int(count)
        values = solution.cost, solution.lower_bound, solution.gap, solution.runtime, scan.compile_time
        for found, value in zip(self._values.values(), values, strict=True):
            found.append(value)
        if scan.true_tuples is not None:
            self._known += 1
            self._true += scan.true_tuples
            self._correct += scan.correct_tuples or 0

    def sums(self) -> dict[str, Any]:
        """Number of scans, of targets found, costs, bounds, seconds of solver and compiler.

        ``optimal`` counts the scans whose status is "optimal"; ``true_tuples``, ``correct_tuples`` and
        their ratio ``share_correct`` are over the scans with known truth, None where there is none.
        """
        optimal = self._sums["optimal"]
        values = {name: math.fsum(found) for name, found in self._values.items()}
        return {
            **{name: count for name, count in self._sums.items() if name != "optimal"},
            "cost": values["cost"],
            "lower_bound": plain(values["lower_bound"]),
            "gap": plain(values["gap"]),
            "optimal": optimal,
            "runtime": values["runtime"],
            "compile_time": values["compile_time"],
            "true_tuples": self._true if self._known else None,
            "correct_tuples": self._correct if self._known else None,
            "share_correct": self._correct / self._true if self._true else None,
        }

    def summary(self, solver: str) -> str:
        """The sums in a few lines."""
        total = self.sums()
        runtimes = self._values["runtime"]
        median = 1e3 * float(np.median(runtimes)) if runtimes else 0.0
        lines = [
            f"{total['scans']} scans, {total['measurements']} measurements: "
            f"{total['targets']} targets, {total['false_alarms']} false alarms",
            f"cost {total['cost']:.6g}, lower bound {_text(total['lower_bound'])}, gap {_text(total['gap'])}",
            f"{solver}: {total['optimal']} of {total['scans']} scans certified optimal, median {median:.3g} ms a scan",
        ]
        if total["share_correct"] is not None:
            lines.append(
                f"{total['correct_tuples']} of {total['true_tuples']} true tuples correct "
                f"({100 * total['share_correct']:.1f} %)"
            )
        if total["compile_time"] >= _WORTH_A_LINE:
            lines.append(
                f"{total['compile_time']:.1f} s more for compiling (once after installation) and loading compiled code"
            )
        return "\n".join(lines)


def frame_of_scan(scan: ScanAssociation, count: int) -> pd.DataFrame:
    """The rows of `Association.to_frame` of a scan, with columns for `count` sensors."""
    import pandas as pd

    number, width = scan.targets.shape
    position, sigma = np.full((number, 3), np.nan), np.full((number, 3), np.nan)
    if scan.positions is not None and scan.covariances is not None:
        position, sigma = scan.positions, np.sqrt(np.diagonal(scan.covariances, axis1=1, axis2=2))
    names = [*(f"sensor_{s + 1}" for s in range(count)), "x", "y", "z", "sigma_x", "sigma_y", "sigma_z"]
    values = [*scan.targets.T, *[np.zeros(number, np.int32)] * (count - width), *position.T, *sigma.T]
    if scan.probabilities is not None:
        names += ["probability_lower", "probability", "probability_upper"]
        values += [*scan.probabilities.T]
    part = pd.DataFrame({"scan": scan.scan, "time": scan.time, "target": np.arange(number)})
    return part.assign(**dict(zip(names, values, strict=True)))


def _text(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.6g}"
