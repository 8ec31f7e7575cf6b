"""Where the set lies: instances, best solutions and proofs as files, and the table of what is known."""

import hashlib
import json
import lzma
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from assoc import check
from assoc._files.output import write_atomically, write_json
from assoc.problem import AssignmentProblem
from assoc.solution import Solution

FOLDER = Path(__file__).parent
TABLE = FOLDER / "best.json"


def instance_file(name: str) -> Path:
    """Where an instance lies."""
    return FOLDER / "instances" / f"{name}.txt.xz"


def solution_file(name: str) -> Path:
    """Where its best solution lies."""
    return FOLDER / "solutions" / f"{name}.txt"


def proof_file(name: str) -> Path:
    """Where the proof lies that the best solution is optimal, if it is."""
    return FOLDER / "proofs" / f"{name}.json.xz"


def digest(name: str) -> str:
    """SHA-256 of an instance as text."""
    with lzma.open(instance_file(name)) as file:
        return hashlib.sha256(file.read()).hexdigest()


def load(name: str) -> AssignmentProblem:
    """Load an instance."""
    return AssignmentProblem.load(instance_file(name))


def solution_text(solution: Solution, cost: str) -> str:
    """Write down a solution."""
    lines = ["assoc-solution 1", f"cost {cost}", *(" ".join(map(str, row)) for row in solution.tuples.tolist())]
    return "\n".join(lines) + "\n"


def exact_cost(problem: check.Problem, tuples: Iterable[Iterable[int]]) -> str:
    """Return what tuples cost, as a decimal.

    Raises check.RefusedError: They are no solution.
    """
    cost = check.cost_of(problem, [tuple(row) for row in tuples])
    whole, rest = divmod(abs(cost), 10**check.DECIMALS)
    return ("-" if cost < 0 else "") + f"{whole}.{rest:0{check.DECIMALS}}".rstrip("0").rstrip(".")


def pack(path: Path, text: str) -> None:
    """Write a text, packed."""
    write_atomically(path, lambda file: file.write(lzma.compress(text.encode(), preset=9)))


def table() -> dict[str, dict[str, Any]]:
    """Return what is known of each instance; empty before anything is."""
    return dict(json.loads(TABLE.read_text())["instances"]) if TABLE.exists() else {}


def write_table(rows: dict[str, dict[str, Any]]) -> None:
    """Write what is known."""
    write_json(TABLE, {"format": "assoc.sdlib", "version": 1, "instances": dict(sorted(rows.items()))})
