"""What a comparison found: as a file, and as the tables of docs/benchmark_set.md."""

import datetime
import json
import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from assoc._files.output import write_text
from experiments.common.results import table
from experiments.sdlib import store

PUBLISHED = store.FOLDER / "comparison.json"
FORMAT = "assoc.sdlib.comparison"
_NEAR = 1e-3
# a claim of optimality is false where the cost is above the best value by more than this share
_SAME = 1e-6
_EARLY = (1.0, 5.0)
# an excess that is rounding
_ROUNDING = 1e-9

Row = dict[str, Any]
Told = list[tuple[Row, float]]
"""Rows of a solver on instances that it takes, and the best value of each."""
Measure = Callable[[Row, float], float | None]


def write_comparison(path: str | Path, rows: list[Row], seconds: float, command: str) -> None:
    """Write the rows of a run."""
    head = {
        "format": FORMAT,
        "version": 1,
        "command": command,
        "date": datetime.date.today().isoformat(),
        "seconds": seconds,
        "machine": f"one core, {platform.machine()}, Python {platform.python_version()}",
    }
    lines = ",\n".join(json.dumps(row) for row in rows)
    write_text(path, f'{json.dumps(head)[:-1]}, "rows": [\n{lines}\n]}}\n')


def read_rows(path: str | Path, seconds: float) -> list[Row]:
    """Read the rows of a run to go on with, none where there is no file yet.

    Raises ValueError: In them solvers had another time.
    """
    if not Path(path).exists():
        return []
    content = json.loads(Path(path).read_text())
    if content["seconds"] != seconds:
        raise ValueError(f"{path}: its rows are of {content['seconds']:g} s, expected {seconds:g} s")
    return list(content["rows"])


def excess(row: Row, best: float, seconds: float) -> float | None:
    """How far above the best value what was found in so many seconds is, as a share of it; None: nothing was."""
    costs = [point[1] for point in row.get("trace", []) if point[0] <= seconds]
    if not costs:
        return None
    share = (min(costs) - best) / max(1.0, abs(best))
    return share if share > _ROUNDING else 0.0


def time_to_near(row: Row, best: float) -> float | None:
    """Seconds until what was found is within 0.1 % of the best value."""
    near = best + _NEAR * max(1.0, abs(best))
    return next((float(point[0]) for point in row.get("trace", []) if point[1] <= near), None)


def time_to_proof(row: Row, best: float) -> float | None:
    """Seconds until the solver said that its solution is optimal, if that is true."""
    if not row.get("proved") or not row["trace"] or is_wrong(row, best):
        return None
    return float(row["trace"][-1][0])


def is_wrong(row: Row, best: float) -> bool:
    """Whether the solver says that its solution is optimal, and there is a better one."""
    return bool(row.get("proved")) and float(row["cost"]) > best + _SAME * max(1.0, abs(best))


def _within(measure: Measure) -> Callable[[Told, float], str]:
    """How many times are within so many seconds."""

    def counted(told: Told, seconds: float) -> str:
        times = [measure(row, best) for row, best in told]
        return str(sum(time is not None and time <= seconds for time in times))

    return counted


def _quality(told: Told, seconds: float) -> str:
    """The mean excess after so many seconds, percent."""
    found = [excess(row, best, seconds) for row, best in told]
    known = [share for share in found if share is not None]
    if not found or len(known) < len(found):
        return f"none on {len(found) - len(known)}"
    return f"{100 * sum(known) / len(found):.3g} %"


def comparison_tables(path: Path = PUBLISHED) -> str:
    """Return the tables of a comparison as text."""
    content = json.loads(path.read_text())
    rows, limit = content["rows"], float(content["seconds"])
    known = {name: float(row["value"]) for name, row in store.table().items()}
    told: dict[str, Told] = {}
    for row in rows:
        told.setdefault(row["solver"], []).extend([(row, known[row["instance"]])] if "trace" in row else [])
    marks = (0.01, 0.1, *_EARLY, limit)

    def summary(cell: Callable[[Told, float], str], marks: Sequence[float] = marks) -> str:
        head = ["solver", "takes", *(f"{mark:g} s" for mark in marks)]
        lines = [[name, str(len(own)), *(cell(own, mark) for mark in marks)] for name, own in told.items()]
        return table(head, lines)

    named = {row["instance"] for row in rows}
    wrong = [f"{row['solver']} on {row['instance']}" for row in rows if is_wrong(row, known[row["instance"]])]
    return "\n\n".join((
        f"`{content['command']}`, {content['date']}, {content['machine']}: {len(named)} instances, "
        f"{len(told)} solvers, {limit:g} s of CPU time each.",
        "**Time to 0.1 %**: instances on which a solver was that near to the best value known, after so long.",
        summary(_within(time_to_near)),
        "**Time to proof**: instances on which it said, truly, that it had the optimum.",
        summary(_within(time_to_proof)),
        f"Said to be optimal, and not: {', '.join(wrong) if wrong else 'none'}.",
        "**Quality**: mean excess over the best value; *none on N*: it had found nothing on N instances.",
        summary(_quality, marks[2:]),
    ))  # fmt: skip
