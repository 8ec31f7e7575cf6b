"""Check a solution of an assignment problem, or a proof of how good it is, in exact arithmetic.

    python -m assoc.check PROBLEM SOLUTION        is it feasible, and what does it cost?
    python -m assoc.check PROBLEM PROOF           the same, and the lower bound that the proof gives

This file needs nothing but Python: copy it anywhere. It shares no code with the solvers. Numbers are whole multiples of
1e-60: nothing is ever rounded. Exit code 0: what the file claims holds; 1: it does not; 2: a file cannot be read.

Why a proof holds. Every measurement (row) must be in exactly one chosen tuple. For any multipliers u of the rows, a
solution costs at least sum(u) if no tuple costs less than the u of its measurements together; where one does, the u of
its first measurement is lowered by what is lacking. A tuple that costs no less than its measurements alone is not
needed. Rows that share no tuple, directly or through others, are bounded apart. In a tree, a node asks whether
measurements a and b are in one tuple: either only tuples remain that have both or neither, or none with both remains.
The bound of a tree is the least of its leaves'.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import re
import sys

DECIMALS = 60
NUMBER = re.compile(r"[+-]?[0-9]{1,60}(\.[0-9]{0,60})?([eE][+-]?[0-9]{1,3})?")
MOST_ROWS = 5_000_000
Row = tuple[int, int]
Column = tuple[int, tuple[Row, ...]]


class RefusedError(Exception):
    """A claim does not hold."""


def number(text: object) -> int:
    """Return a decimal number as a multiple of 1e-60."""
    if not isinstance(text, str) or not NUMBER.fullmatch(text):
        raise ValueError(f"expected a decimal number, got {text!r:.40}")
    digits, _, exponent = text.lower().partition("e")
    whole, _, fraction = digits.partition(".")
    shift = DECIMALS + int(exponent or "0") - len(fraction)
    value = int(whole + fraction)
    if shift >= 0:
        return value * 10**shift
    value, lost = divmod(value, 10**-shift)
    if lost:
        raise ValueError(f"{text}: has more than {DECIMALS} decimals")
    return value


def shown(value: int) -> str:
    """Return a number with nine decimals, rounded down."""
    units = value // 10 ** (DECIMALS - 9)
    return f"{'-' if units < 0 else ''}{abs(units) // 10**9}.{abs(units) % 10**9:09d}"


class Problem:
    """Sizes of the sensors, whether dummies are allowed, and the cost of each tuple."""

    def __init__(self, sizes: list[int], dummies: bool, costs: dict[tuple[int, ...], int]) -> None:
        self.sizes, self.dummies, self.costs = sizes, dummies, costs
        lines = sorted(f"{one} {cost}" for one, cost in costs.items())
        text = "\n".join([f"{sizes} {dummies}", *lines])
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        every = [(s, i) for s, size in enumerate(sizes) for i in range(1, size + 1)]
        # without dummies only the measurements of the smallest sensors must be used
        self.needed = {row for row in every if dummies or sizes[row[0]] == min(sizes)}


def rows_of(one: tuple[int, ...]) -> tuple[Row, ...]:
    """Return the measurements (sensor, index) of a tuple."""
    return tuple((s, i) for s, i in enumerate(one) if i)


def read_problem(path: str) -> Problem:
    """Read a problem in text form."""
    lines = (line.split() for line in read_text(path).splitlines() if line.strip() and not line.startswith("#"))
    head = [next(lines, [""]) for _ in range(4)]
    if [line[0] for line in head] != ["assoc-problem", "sizes", "dummies", "tuples"] or head[0][1:] != ["1"]:
        raise ValueError("the first lines must be 'assoc-problem 1', 'sizes N ...', 'dummies yes|no', 'tuples N'")
    sizes, dummies, count = list(map(whole, head[1][1:])), head[2][1:] == ["yes"], whole("".join(head[3][1:]))
    if not sizes or head[2][1:] not in (["yes"], ["no"]):
        raise ValueError("expected the sizes of the sensors, and 'dummies yes' or 'dummies no'")
    costs: dict[tuple[int, ...], int] = {}
    for words in lines:
        one, cost = tuple(whole(word) for word in words[1:]), number(words[0])
        if len(one) != len(sizes) or any(i > size for i, size in zip(one, sizes, strict=True)) or not any(one):
            raise ValueError(f"{' '.join(words):.60}: no tuple of these sizes")
        if not dummies and not all(one):
            raise ValueError(f"{' '.join(words):.60}: has a dummy, but the problem has none")
        costs[one] = min(cost, costs.get(one, cost))
        count -= 1
    if count:
        raise ValueError("the number of tuples is not the one that is announced")
    if sum(sizes) > MOST_ROWS:
        raise ValueError(f"has more than {MOST_ROWS} measurements")
    problem = Problem(sizes, dummies, costs)
    if dummies and any(alone(row, sizes) not in costs for row in problem.needed):
        raise ValueError("with dummies, each measurement must be listed as a tuple of its own")
    return problem


def alone(row: Row, sizes: list[int]) -> tuple[int, ...]:
    """Return the tuple of one measurement."""
    return tuple(row[1] if s == row[0] else 0 for s in range(len(sizes)))


def whole(word: object) -> int:
    """Return a whole number >= 0 that can be an index; JSON's are read as text, too."""
    if not isinstance(word, str) or not re.fullmatch(r"[0-9]{1,9}", word):
        raise ValueError(f"expected a whole number, got {word!r:.40}")
    return int(word)


def read_text(path: str) -> str:
    """Return what a file, or one packed by xz, holds, as far as it is not larger than 2 GB."""
    with lzma.open(path) if path.endswith(".xz") else open(path, "rb") as file:
        return file.read(2_000_000_000).decode()


def cost_of(problem: Problem, chosen: list[tuple[int, ...]]) -> int:
    """Return what a choice of tuples costs; refuse it where it is no solution."""
    used: set[Row] = set()
    for one in chosen:
        if one not in problem.costs:
            raise RefusedError(f"the solution has the tuple {one}, which is not in the problem")
        for row in rows_of(one):
            if row in used:
                raise RefusedError(f"the solution uses measurement {row[1]} of sensor {row[0] + 1} twice")
            used.add(row)
    for s, i in sorted(problem.needed - used):
        raise RefusedError(f"the solution does not use measurement {i} of sensor {s + 1}")
    return sum(problem.costs[one] for one in chosen)


def components(problem: Problem) -> list[tuple[list[Row], list[Column]]]:
    """Return rows that belong together, with their tuples, but for tuples that are not needed."""
    costs, sizes = problem.costs, problem.sizes
    columns: list[Column] = []
    for one, cost in costs.items():
        rows = rows_of(one)
        if len(rows) > 1 and problem.dummies and cost >= sum(costs[alone(row, sizes)] for row in rows):
            continue
        columns.append((cost, rows))
    parent = {(s, i): (s, i) for s, size in enumerate(sizes) for i in range(1, size + 1)}

    def root(row: Row) -> Row:
        while parent[row] != row:
            parent[row] = parent[parent[row]]
            row = parent[row]
        return row

    for _, rows in columns:
        first = root(rows[0])
        for row in rows[1:]:
            parent[root(row)] = first
    found: dict[Row, tuple[list[Row], list[Column]]] = {}
    for row in parent:
        found.setdefault(root(row), ([], []))[0].append(row)
    for column in columns:
        found[root(column[1][0])][1].append(column)
    return list(found.values())


def leaf_bound(columns: list[Column], rows: list[Row], needed: set[Row], u: dict[Row, int]) -> int | None:
    """Return the bound that multipliers give; None where a row that must be covered has no tuple."""
    covered = {row for _, own in columns for row in own}
    if any(row in needed and row not in covered for row in rows):
        return None
    # what may stay uncovered must not earn by it
    u = {row: u[row] if row in needed else min(u[row], 0) for row in rows}
    for cost, own in columns:
        lack = cost - sum(u[row] for row in own)
        if lack < 0:
            u[own[0]] += lack
    return sum(u.values())


def tree_bound(nodes: object, columns: list[Column], rows: list[Row], needed: set[Row]) -> int | None:
    """Return the least bound of a tree's leaves."""
    if not isinstance(nodes, list):
        raise ValueError("a tree must be a list of nodes")
    least, todo = None, [(0, columns, needed)]
    while todo:
        at, columns, needed = todo.pop()
        node = nodes[at] if at < len(nodes) else None
        if not isinstance(node, dict):
            raise ValueError(f"a tree lacks node {at}")
        if "pair" not in node:
            values = node.get("multipliers")
            if not isinstance(values, list) or len(values) != len(rows):
                raise ValueError(f"leaf {at} of a tree must have a multiplier for each of its rows")
            bound = leaf_bound(columns, rows, needed, dict(zip(rows, map(number, values), strict=True)))
            if bound is not None and (least is None or bound < least):
                least = bound
            continue
        pair, children = [as_row(one) for one in listed(node["pair"], 2)], listed(node.get("children"), 2)
        if pair[0] == pair[1] or any(row not in rows for row in pair) or min(map(whole, children)) <= at:
            raise ValueError(f"node {at} of a tree must name two rows of it, and children that come after it")
        together = [one for one in columns if (pair[0] in one[1]) == (pair[1] in one[1])]
        apart = [one for one in columns if not (pair[0] in one[1] and pair[1] in one[1])]
        todo += [(whole(children[0]), together, needed | {*pair}), (whole(children[1]), apart, needed)]
    return least


def listed(value: object, count: int | None = None) -> list[object]:
    """Return a list, of so many things."""
    if not isinstance(value, list) or (count is not None and len(value) != count):
        raise ValueError(f"expected a list{'' if count is None else f' of {count}'}, got {value!r:.40}")
    return value


def as_row(value: object) -> Row:
    """Return a measurement from its sensor (1, 2, ...) and index."""
    sensor, index = listed(value, 2)
    return whole(sensor) - 1, whole(index)


def proved(problem: Problem, proof: dict[str, object]) -> int:
    """Return the lower bound that a proof gives."""
    if proof.get("problem") != problem.digest:
        raise RefusedError("the proof is for another problem")
    by_sensor = listed(proof.get("multipliers"), len(problem.sizes))
    values = [listed(one, size) for one, size in zip(by_sensor, problem.sizes, strict=True)]
    u = {(s, i): number(value) for s, own in enumerate(values) for i, value in enumerate(own, 1)}
    trees: dict[Row, object] = {}
    for one in listed(proof.get("trees")):
        if not isinstance(one, dict):
            raise ValueError("a tree must have rows and nodes")
        trees[min((as_row(row) for row in listed(one.get("rows"))), default=(-1, 0))] = one
    total = 0
    for rows, columns in components(problem):
        tree = trees.pop(min(rows), None)
        if isinstance(tree, dict):
            if sorted(rows) != [as_row(row) for row in listed(tree.get("rows"))]:
                raise RefusedError("a tree's rows are not those of a component of the problem")
            bound = tree_bound(tree.get("nodes"), columns, sorted(rows), problem.needed)
        else:
            bound = leaf_bound(columns, rows, problem.needed, u)
        if bound is None:
            raise RefusedError("a component has no solution")
        total += bound
    if trees:
        raise RefusedError("a tree's rows are not those of a component of the problem")
    return total


def solution_of(text: str) -> tuple[list[tuple[int, ...]], str | None]:
    """Read a solution in text form: its tuples, and the cost that it claims."""
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines or lines[0] != ["assoc-solution", "1"]:
        raise ValueError("the first line must be 'assoc-solution 1'")
    claims = [line[1] for line in lines[1:] if line[0] == "cost" and len(line) == 2]
    return [tuple(map(whole, line)) for line in lines[1:] if line[0] != "cost"], claims[0] if claims else None


def check(problem: Problem, text: str) -> list[str]:
    """Return what holds, in lines; raise `RefusedError` where a claim does not."""
    proof = json.loads(text, parse_float=str, parse_int=str) if text.lstrip().startswith("{") else None
    if proof is None:
        chosen, claim = solution_of(text)
    elif proof.get("format") != "assoc-proof" or proof.get("version") != "1":
        raise ValueError("expected the format 'assoc-proof', version 1")
    else:
        chosen, claim = [tuple(map(whole, listed(one))) for one in listed(proof.get("tuples"))], proof.get("cost")
    cost = cost_of(problem, chosen)
    if claim is not None and number(claim) != cost:
        raise RefusedError(f"the solution costs {shown(cost)}, not {claim}")
    lines = [f"feasible, cost {shown(cost)}"]
    if proof is not None:
        bound = proved(problem, proof)
        lines.append(f"proved: no solution costs less than {shown(bound)} (gap {shown(cost - bound)})")
        if "bound" in proof and bound < number(proof["bound"]):
            raise RefusedError(f"the proof gives the bound {shown(bound)}, not {proof['bound']}")
    return lines


def main(words: list[str]) -> int:
    """Run the program; its exit code."""
    if len(words) != 2 or words[0].startswith("-"):
        print(__doc__)
        return 0 if words[:1] in (["-h"], ["--help"]) else 2
    path = words[0]
    try:
        problem = read_problem(path)
        path = words[1]
        print("\n".join(check(problem, read_text(path))))
    except RefusedError as error:
        print(f"{path}: refused: {error}", file=sys.stderr)
        return 1
    except (OSError, ValueError, RecursionError, AttributeError, MemoryError, lzma.LZMAError, EOFError) as error:
        print(f"{path}: {getattr(error, 'strerror', None) or error}".splitlines()[0], file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
