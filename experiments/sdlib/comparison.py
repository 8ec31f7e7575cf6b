"""What a comparison found: as a file, and as the tables of docs/benchmark_set.md."""

import datetime
import json
import platform
from collections.abc import Callable
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


def comparison_tables(path: Path = PUBLISHED) -> str:
    """Return the tables of a comparison as text."""
    content = json.loads(path.read_text())
    rows, limit = content["rows"], float(content["seconds"])
    known = {name: float(row["value"]) for name, row in store.table().items()}
    by_place = {(row["instance"], row["solver"]): row for row in rows}
    instances = list(dict.fromkeys(row["instance"] for row in rows))
    solvers = list(dict.fromkeys(row["solver"] for row in rows))

    def told(solver: str) -> list[tuple[Row, float]]:
        own = [by_place.get((name, solver), {"fault": "was not run"}) for name in instances]
        return [(row, known[name]) for row, name in zip(own, instances, strict=True) if "trace" in row]

    def within(solver: str, seconds: float) -> str:
        found = [time_to_near(row, best) for row, best in told(solver)]
        return str(sum(time is not None and time <= seconds for time in found))

    def quality(solver: str, seconds: float) -> str:
        found = [excess(row, best, seconds) for row, best in told(solver)]
        if not found or any(one is None for one in found):
            missing = sum(one is None for one in found)
            return f"none on {missing}"
        return f"{100 * sum(one or 0.0 for one in found) / len(found):.3g} %"

    def proofs(solver: str, seconds: float) -> str:
        found = [time_to_proof(row, best) for row, best in told(solver)]
        return str(sum(time is not None and time <= seconds for time in found))

    marks = (0.01, 0.1, *_EARLY, limit)
    spoken = [f"{mark:g} s" for mark in marks]
    wrong = [f"{row['solver']} on {row['instance']}" for row in rows if is_wrong(row, known[row["instance"]])]
    every = [[solver, str(len(told(solver)))] for solver in solvers]
    lines = [
        f"`{content['command']}`, {content['date']}, {content['machine']}: {len(instances)} instances, "
        f"{len(solvers)} solvers, {limit:g} s of CPU time each.",
        "",
        "**Time to 0.1 %**: instances on which a solver was that near to the best value known, after so long.",
        "",
        table(["solver", "takes", *spoken], [[*one, *(within(one[0], mark) for mark in marks)] for one in every]),
        "",
        "**Time to proof**: instances on which it said, truly, that it had the optimum.",
        "",
        table(["solver", "takes", *spoken], [[*one, *(proofs(one[0], mark) for mark in marks)] for one in every]),
        "",
        f"Said to be optimal, and not: {', '.join(wrong) if wrong else 'none'}.",
        "",
        "**Quality**: mean excess over the best value; *none on N*: it had found nothing on N instances.",
        "",
        table(
            ["solver", "takes", *spoken[2:]], [[*one, *(quality(one[0], mark) for mark in marks[2:])] for one in every]
        ),
        "",
        "**Seconds to 0.1 %** (-: cannot take the instance; >: not in the time)",
        "",
        _matrix(instances, solvers, by_place, known, time_to_near),
        "",
        "**Seconds to proof** (of those that prove)",
        "",
        _matrix(
            instances,
            [solver for solver in solvers if any(time_to_proof(row, best) is not None for row, best in told(solver))],
            by_place,
            known,
            time_to_proof,
        ),
    ]
    return "\n".join(lines)


def _matrix(
    instances: list[str],
    solvers: list[str],
    by_place: dict[tuple[str, str], Row],
    known: dict[str, float],
    measure: Callable[[Row, float], float | None],
) -> str:
    def cell(name: str, solver: str) -> str:
        row = by_place.get((name, solver), {})
        if "trace" not in row:
            return "-"
        time = measure(row, known[name])
        return ">" if time is None else f"{time:.2g}" if time < 10.0 else f"{time:.0f}"

    return table(["instance", *solvers], [[name, *(cell(name, solver) for solver in solvers)] for name in instances])
