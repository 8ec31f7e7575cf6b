"""Solve an instance, keep what is better than what was known, and prove it."""

import lzma
import math
import tempfile
import time
from pathlib import Path
from typing import Any

from assoc import check
from assoc._files.output import write_text
from assoc.problem import AssignmentProblem
from assoc.proofs.write import write_proof
from assoc.solution import Solution
from assoc.solvers.assign import assign
from experiments.sdlib import store
from experiments.sdlib.instances import Instance


def solve(instance: Instance, known: dict[str, Any] | None, solver: str, seconds: float, today: str) -> dict[str, Any]:
    """Solve an instance; return its row of the table, and write solution and proof where they are better."""
    problem = store.load(instance.name)
    started = time.perf_counter()
    solution = assign(problem, solver, time_limit=seconds)
    taken = time.perf_counter() - started
    root = assign(problem, "lagrangian", time_limit=min(seconds, 10.0)).lower_bound
    row = {
        "family": instance.family,
        "digest": store.digest(instance.name),
        "sizes": problem.sizes.tolist(),
        "dummies": problem.dummy,
        "tuples": problem.num_tuples,
        "components": len(problem.components()),
        "root bound": root,
        "value": None,
        "bound": -math.inf,
        "status": "open",
        "who": f"assoc {solver}",
        "when": today,
        "seconds": round(taken, 2),
        **(known or {}),
    }
    cost = store.exact_cost(check.read_problem(str(store.instance_file(instance.name))), solution.tuples.tolist())
    better = row["value"] is None or float(cost) < float(row["value"])
    if better:
        row.update(value=cost, who=f"assoc {solver}", when=today, seconds=round(taken, 2))
        store.solution_file(instance.name).parent.mkdir(exist_ok=True)
        write_text(store.solution_file(instance.name), store.solution_text(solution, cost))
    row["bound"] = max(row["bound"], solution.lower_bound)
    if (better or row["status"] != "optimal") and solution.status == "optimal":
        bound = _prove(instance.name, problem, solution, seconds)
        row["bound"] = max(row["bound"], bound)
        if bound >= float(cost):
            row.update(status="optimal", bound=bound, seconds=round(taken, 2))
    return row


def _prove(name: str, problem: AssignmentProblem, solution: Solution, seconds: float) -> float:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proof.json"
        bound = write_proof(path, problem, solution, time_limit=seconds)
        store.proof_file(name).parent.mkdir(exist_ok=True)
        store.pack(store.proof_file(name), path.read_text())
    return bound


def check_row(name: str, row: dict[str, Any]) -> str | None:
    """Check the solution of a row of the table and, if it says optimal, the proof; what is wrong."""
    try:
        if store.digest(name) != row["digest"]:
            return "is not the instance that the table is about"
        problem = check.read_problem(str(store.instance_file(name)))
        chosen, _ = check.read_solution(store.solution_file(name).read_text())
        cost = store.exact_cost(problem, chosen)
        if cost != row["value"]:
            return f"costs {cost}, the table says {row['value']}"
        if row["status"] != "optimal":
            return None
        with lzma.open(store.proof_file(name)) as file:
            proof = file.read().decode()
        said = check.check(problem, proof)[-1]
        if "(gap 0.000000000)" not in said:
            return f"what is {said}"
    except (OSError, ValueError, check.RefusedError) as error:
        return str(error)
    return None
