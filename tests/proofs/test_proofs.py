"""Proofs: they prove the optimum; the checker accepts them and refuses spoiled ones."""

import copy
import json
import operator
import subprocess
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import assoc
from assoc import check
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.packing.prepare import prepare
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.proofs import write_proof
from assoc.proofs.write import exact_problem
from assoc.simulation import simulate
from tests.reliability.exact import exact_optimum
from tests.running import process

ALONE = Path(check.__file__)


def random_problem(rng: np.random.Generator) -> assoc.AssignmentProblem:
    """A small problem with fractional linear programs now and then."""
    sizes = rng.integers(2, 5, size=rng.integers(2, 5))
    tuples = np.stack(np.meshgrid(*(np.arange(n + 1) for n in sizes), indexing="ij"), -1).reshape(-1, sizes.size)
    tuples = tuples[np.count_nonzero(tuples, axis=1) > 1]
    tuples = tuples[rng.random(len(tuples)) < 0.6]
    costs = rng.normal(-2.0, 3.0, len(tuples)) if rng.random() < 0.5 else rng.integers(-3, 1, len(tuples)).astype(float)
    return assoc.AssignmentProblem(tuples, costs, sizes)


def odd_cycle() -> assoc.AssignmentProblem:
    """The smallest problem that its linear program leaves open."""
    return assoc.AssignmentProblem([[1, 1, 0], [0, 1, 1], [1, 0, 1]], [-3.0, -3.0, -2.5], [1, 1, 1])


def branched() -> assoc.AssignmentProblem:
    """A small problem whose proof needs all that proofs have: two stages, a tree, a cut."""
    rng = np.random.default_rng(105)
    tuples = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    tuples = tuples[np.count_nonzero(tuples, axis=1) > 1]
    tuples = tuples[rng.random(len(tuples)) < 0.35]
    return assoc.AssignmentProblem(tuples, np.round(rng.normal(-2.0, 2.0, len(tuples)), 2), [4, 4, 4])


def run_alone(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The checker as others use it: only the file, isolated from the package."""
    return process("-I", "-S", ALONE, *words, cwd=folder)


@pytest.mark.parametrize("dummy", [True, False])
def test_what_is_proved_is_the_optimum(tmp_path, dummy):
    rng = np.random.default_rng(1)
    trees = 0
    for number in range(25):
        if dummy:
            problem = random_problem(rng)
        else:
            sizes = (4, 4, 4) if number % 2 else (3, 4, 5)
            costs = rng.integers(0, 100, sizes) / 100.0
            problem = assoc.AssignmentProblem.from_dense(costs, dummy=False)
        solution = assoc.assign(problem)
        bound = write_proof(tmp_path / "proof.json", problem, solution)
        assert bound == pytest.approx(float(exact_optimum(problem)), abs=1e-7)
        assert bound <= solution.cost + 1e-12
        trees += len(json.loads((tmp_path / "proof.json").read_text())["trees"])
    assert trees > 3


def test_proofs_near_the_largest_costs(tmp_path):
    problem = assoc.AssignmentProblem(odd_cycle().tuples[:3], [-6.3e298, -5.4e298, -4.5e298], [1, 1, 1])
    solution = assoc.assign(problem)
    assert write_proof(tmp_path / "proof.json", problem, solution) == pytest.approx(solution.cost)


def test_any_solver_s_answer_gets_a_proof_of_its_gap(tmp_path):
    problem = odd_cycle()
    greedy = assoc.assign(problem, "greedy")
    worse = assoc.assign(assoc.AssignmentProblem([[1, 0, 1]], [-2.5], [1, 1, 1]))
    assert write_proof(tmp_path / "proof.json", problem, greedy) == -3.0
    content = json.loads((tmp_path / "proof.json").read_text())
    content["tuples"], content["cost"] = worse.tuples.tolist(), "-2.5"
    lines = check.check(exact_problem(problem), json.dumps(content))
    assert lines[0] == "feasible, cost -2.500000000" and "gap 0.5" in lines[1]


@pytest.mark.parametrize("limit", [{"nodes": 1}, {"time_limit": 1e-9}])
def test_too_few_nodes_and_too_little_time_leave_a_gap(tmp_path, limit):
    problem = branched()
    solution = assoc.assign(problem)
    bound = write_proof(tmp_path / "proof.json", problem, solution, **limit)
    assert solution.cost - 2.0 < bound < solution.cost - 0.001
    done = json.loads((tmp_path / "proof.json").read_text())
    assert f"gap {solution.cost - bound:.6f}" in check.check(exact_problem(problem), json.dumps(done))[1]


def test_the_file_alone_checks_what_the_package_writes(tmp_path):
    scene = simulate("bearing-only", seed=0, targets=8, scans=1)
    problem = assoc.build_problem(scene, scene.scan(0))
    problem.save(tmp_path / "problem.txt")
    solution = assoc.assign(problem, proof=tmp_path / "proof.json")
    assert solution.status == "optimal"
    done = run_alone(tmp_path, "problem.txt", "proof.json")
    assert (done.returncode, done.stderr) == (0, "")
    first, second = done.stdout.splitlines()
    assert first.startswith("feasible, cost -108.4") and second.startswith("proved: no solution costs less than -108.4")
    text = "assoc-solution 1\n" + "\n".join(" ".join(map(str, one)) for one in solution.tuples.tolist()) + "\n"
    (tmp_path / "solution.txt").write_text(text)
    assert run_alone(tmp_path, "problem.txt", "solution.txt").stdout.startswith("feasible, cost -108.4")
    (tmp_path / "solution.txt").write_text(text.replace("assoc-solution 1\n", "assoc-solution 1\ncost -200\n"))
    done = run_alone(tmp_path, "problem.txt", "solution.txt")
    assert done.returncode == 1 and "refused: the solution costs -108.4" in done.stderr


def test_the_bound_is_that_of_fractions():
    """An independent version of the checker's leaf: multipliers made feasible with fractions give the same bound."""
    problem = odd_cycle()
    packing = prepare(problem).packing
    u = LinearProgram(packing).solve().duals.tolist()
    exact = exact_problem(problem)
    ((rows, columns),) = check.components(exact.rows, exact.columns)
    values = {row: check.number(repr(one)) for row, one in zip(rows, u, strict=True)}
    total = {row: Fraction(one) for row, one in zip(rows, map(repr, u), strict=True)}
    for cost, own in columns:
        lack = Fraction(cost, 10**60) - sum(total[row] for row in own)
        total[own[0]] += min(lack, Fraction(0))
    assert Fraction(check.bounded(columns, exact.needed, values, {}) or 0, 10**60) == sum(total.values())


@pytest.fixture(scope="module")
def valid(tmp_path_factory):
    """A proof with two stages, a tree with a cut, and components that need no tree."""
    problem = branched()
    path = tmp_path_factory.mktemp("proof") / "proof.json"
    assert write_proof(path, problem, assoc.assign(problem)) == -20.04 == float(exact_optimum(problem))
    proof = json.loads(path.read_text())
    assert len(proof["multipliers"]) == 2 and len(proof["trees"]) == 1
    assert len(proof["trees"][0]["cuts"]) == 1 and len(proof["trees"][0]["nodes"]) == 3
    return exact_problem(problem), proof


def changed(keys: tuple[object, ...], change: Callable[[Any, Any], None]):
    """A change of what these keys lead to: `change` of what holds it, and the last key."""

    def at(proof):
        *path, last = keys
        for key in path:
            proof = proof[key]
        change(proof, last)

    return at


def replaced(*keys: object, by: object):
    return changed(keys, lambda part, key: operator.setitem(part, key, by))


def raised(*keys: object, by: float):
    return changed(keys, lambda part, key: operator.setitem(part, key, part[key] + by))


def removed(*keys: object):
    return changed(keys, operator.delitem)


TREE = ("trees", 0, "nodes")
SPOILED = {
    "another problem": (replaced("problem", by="0" * 64), "for another problem"),
    "no stage": (replaced("multipliers", by=[]), "expected a list"),
    "the first stage left out": (removed("multipliers", 0), "not those of a component"),
    "the first stage too weak": (raised("multipliers", 0, 0, 1, by=-1.0), "not those of a component"),
    "a multiplier too low": (raised("multipliers", 1, 1, 3, by=-1.0), "gives the bound"),
    "a multiplier missing": (removed("multipliers", 0, 1, 0), "expected a list of 4"),
    "a multiplier that is no number": (replaced("multipliers", 0, 0, 0, by="x"), "expected a decimal number"),
    "a leaf's multiplier too low": (raised(*TREE, 1, "multipliers", 0, by=-1.0), "gives the bound"),
    "a leaf without multipliers": (removed(*TREE, 1, "multipliers"), "must have a multiplier"),
    "a branch left out": (removed(*TREE, 2), "lacks node"),
    "the tree left out": (removed("trees", 0), "gives the bound"),
    "one child for both answers": (replaced(*TREE, 0, "children", by=[1, 1]), "of its own after it"),
    "the answers exchanged": (replaced(*TREE, 0, "children", by=[2, 1]), "gives the bound"),
    "a pair of one row": (replaced(*TREE, 0, "pair", by=[[1, 1], [1, 1]]), "must name two rows"),
    "a cut of an even set": (removed("trees", 0, "cuts", 0, 0), "does not follow"),
    "a cut with a row twice": (replaced("trees", 0, "cuts", 0, 0, by=[1, 4]), "does not follow"),
    "another cut": (replaced("trees", 0, "cuts", 0, 0, by=[1, 2]), "gives the bound"),
    "a cut left out": (replaced("trees", 0, "cuts", by=[]), "must have a multiplier"),
    "a cut that earns": (replaced(*TREE, 1, "multipliers", -1, by=3.735), "gives the bound"),
    "a target too high": (replaced("trees", 0, "target", by="-14"), "gives the bound"),
    "a row that is not there": (replaced("trees", 0, "rows", 0, by=[3, 9]), "not those of a component"),
    "a wrong cost": (replaced("cost", by="-20.5"), "the solution costs"),
    "a bound above what is proved": (replaced("bound", by="-20.03"), "gives the bound"),
    "a tuple twice": (lambda proof: proof["tuples"].append(proof["tuples"][0]), "twice"),
    "a tuple left out": (removed("tuples", 0), "does not use measurement"),
    "a tuple of another problem": (replaced("tuples", 0, by=[3, 3, 1]), "not in the problem"),
    "a later version": (replaced("version", by=2), "expected the format"),
}


@pytest.mark.parametrize("how", SPOILED)
def test_spoiled_proofs_are_refused(valid, how):
    problem, proof = valid
    assert "proved" in check.check(problem, json.dumps(proof))[1]
    spoiled = copy.deepcopy(proof)
    change, reason = SPOILED[how]
    change(spoiled)
    with pytest.raises((check.RefusedError, ValueError), match=reason):
        check.check(problem, json.dumps(spoiled))


def test_no_multipliers_prove_more_than_the_optimum(valid):
    """Nor do wrong targets and cuts: every claim that the checker accepts is true."""
    problem, proof = valid
    rng = np.random.default_rng(0)
    worse = check.number("-19.9")
    proved = 0
    for _ in range(400):
        other = copy.deepcopy(proof)
        (tree,) = other["trees"]
        stages = [values for stage in other["multipliers"] for values in stage]
        for values in (*stages, *(node.get("multipliers", []) for node in tree["nodes"])):
            if rng.random() < 0.3:
                values[:] = [value + rng.normal(0.0, rng.choice([1e-9, 0.1, 1.0, 100.0])) for value in values]
        if rng.random() < 0.5:
            tree["target"] = str(-12.91 + rng.choice([-1.0, 0.004, 0.5, 10.0]))
        if rng.random() < 0.5:
            size = rng.choice([1, 3, 5, 7])
            tree["cuts"] = [[tree["rows"][i] for i in rng.permutation(len(tree["rows"]))[:size]]]
        text = json.loads(json.dumps(other), parse_float=str, parse_int=str)
        # as the proof of a worse solution, with a higher target
        for target in (check.number("-20.04"), worse):
            try:
                bound = check.proved(problem, text, target)
            except check.RefusedError:
                continue
            proved += 1
            assert bound <= check.number("-20.04")
    assert proved > 50


def test_trees_without_end_are_refused(valid, monkeypatch):
    """Nodes that are shared would double the work at each, and a chain of them would keep all its siblings."""
    problem, proof = valid
    pair = proof["trees"][0]["nodes"][0]["pair"]
    shared = [{"pair": pair, "children": [i + 1, i + 1]} for i in range(60)]
    with pytest.raises(ValueError, match="children of its own"):
        check.check(problem, json.dumps({**proof, "trees": [{**proof["trees"][0], "nodes": shared}]}))
    monkeypatch.setattr(check, "DEEPEST", 0)
    with pytest.raises(ValueError, match="deeper than 0"):
        check.check(problem, json.dumps(proof))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("assoc-problem 1\nsizes 1 1\n", "first lines"),
        ("assoc-problem 1\nsizes 1 -1\ndummies yes\ntuples 0\n", "whole number"),
        ("assoc-problem 1\nsizes 1 1\ndummies maybe\ntuples 0\n", "dummies yes"),
        ("assoc-problem 1\nsizes 1 1\ndummies yes\ntuples 2\n-1 1 1\n", "number of tuples"),
        ("assoc-problem 1\nsizes 1 1\ndummies no\ntuples 1\n-1 1 2\n", "no tuple of these sizes"),
        ("assoc-problem 1\nsizes 1 1\ndummies no\ntuples 1\nnan 1 1\n", "decimal number"),
        ("assoc-problem 1\nsizes 999999999\ndummies yes\ntuples 0\n", "measurements"),
        ("assoc-problem 1\nsizes 1 1\ndummies no\ntuples 1\n-1 1 0\n", "without dummies"),
        # what would take more memory or time than there is
        ("assoc-problem 1\nsizes 2 2\ndummies yes\ntuples 999999999\n0 1 0\n", "number of tuples"),
        ("assoc-problem 1\nsizes 1 1\ndummies yes\ntuples " + "9" * 400_000 + "\n", ""),
        ("assoc-problem 1\nsizes 1 1\ndummies yes\ntuples 1\n1e99999999 1 1\n", ""),
        ("assoc-problem 1\nsizes 1 1\ndummies yes\ntuples 1\n" + "9" * 1_000_000 + " 1 1\n", ""),
    ],
)
def test_problems_that_cannot_be_read(tmp_path, text, reason):
    (tmp_path / "p.txt").write_text(text)
    (tmp_path / "s.txt").write_text("assoc-solution 1\n1 1\n")
    done = run_alone(tmp_path, "p.txt", "s.txt")
    assert done.stderr.count("\n") <= 1 and "Traceback" not in done.stderr
    if reason:
        assert done.returncode == 2 and done.stderr.startswith("p.txt: ") and reason in done.stderr
        # the package adds singletons that are not listed
        if "tuple of its own" not in reason:
            with pytest.raises((InvalidInputError, LimitExceededError)):
                assoc.AssignmentProblem.load(tmp_path / "p.txt")


@pytest.mark.parametrize(
    ("lines", "code", "words"),
    [
        ("cost -4.5\n1 1\n0 2\n", 0, "feasible, cost -4.500000000"),
        ("1 1\n", 1, "does not use measurement 2 of sensor 2"),
        ("1 1\n0 1\n0 2\n", 1, "uses measurement 1 of sensor 2 twice"),
        ("1 2\n0 1\n", 1, "which is not in the problem"),
        ("cost -4.6\n1 1\n0 2\n", 1, "costs -4.500000000, not -4.6"),
    ],
)
def test_solutions_are_judged(tmp_path, lines, code, words):
    assoc.AssignmentProblem([[1, 1], [0, 1]], [-4.5, 0.0], [1, 2]).save(tmp_path / "p.txt")
    (tmp_path / "s.txt").write_text(f"assoc-solution 1\n{lines}")
    done = run_alone(tmp_path, "p.txt", "s.txt")
    assert done.returncode == code and words in done.stdout + done.stderr
    (tmp_path / "s.txt").write_text(lines)
    assert "the first line must be 'assoc-solution 1'" in run_alone(tmp_path, "p.txt", "s.txt").stderr
