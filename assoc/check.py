"""Check a solution of an assignment problem, or a proof of how good it is, in exact arithmetic.

    python -m assoc.check PROBLEM SOLUTION        is it feasible, and what does it cost?
    python -m assoc.check PROBLEM PROOF           the same, and the lower bound that the proof gives

Needs nothing but Python: copy it anywhere. It shares no code with the solvers. Numbers are whole multiples of 1e-60:
nothing is ever rounded. Exit code 0: the file's claims hold; 1: they do not; 2: a file cannot be read.

Why a proof holds. Every measurement (row) must be in exactly one chosen tuple. For any multipliers u of the rows, a
solution costs at least sum(u) if no tuple costs less than the sum of u over its measurements; where a tuple does, the u
of its first row is lowered by the difference. If a tuple costs x more than the sum of its u, any solution with it costs
at least sum(u) + x: if that exceeds the target, the cost of the given solution, the tuple is dropped. So are tuples
that cost at least as much as their measurements alone. Components, rows not connected by tuples, are bounded
separately. A node of a tree branches on whether rows a and b are in one tuple: in one child only tuples with both or
neither remain, in the other none with both; the tree's bound is the least of its leaves'. A cut is a set of n rows,
n odd: at most (n - 1) / 2 pairs of them are in chosen tuples (half the sum of the rows, rounded down); it is one more
row, with a multiplier of at most 0. Costs are multiples of a unit, and so are solutions' costs: bounds are rounded up
to the next multiple.
"""

from __future__ import annotations

import hashlib
import json
import lzma
import math
import os
import re
import sys
from collections import Counter

DECIMALS = 60
NUMBER = re.compile(r"[+-]?[0-9]{1,400}(\.[0-9]{0,60})?([eE][+-]?[0-9]{1,3})?")
MOST_ROWS, MOST_BYTES, DEEPEST = 1_000_000, 200_000_000, 1_000
UNPACKED, TIMES = 4_000_000, 30  # most bytes of an unpacked file, or this many times its packed size
Row = tuple[int, int]  # sensor, index from 1; cuts are (-1, number)
Column = tuple[int, tuple[Row, ...]]  # cost, rows


class RefusedError(Exception):
    """A claim does not hold."""


def number(text: object) -> int:
    """Return a decimal number as a multiple of 1e-60."""
    if not isinstance(text, str) or not NUMBER.fullmatch(text):
        raise ValueError(f"expected a decimal number, got {text!r:.40}")
    digits, _, exponent = text.lower().partition("e")
    whole, _, fraction = digits.partition(".")
    shift = DECIMALS + int(exponent or "0") - len(fraction)
    value, lost = divmod(int(whole + fraction) * 10 ** max(shift, 0), 10 ** max(-shift, 0))
    if lost:
        raise ValueError(f"{text}: has more than {DECIMALS} decimals")
    return value


def shown(value: int) -> str:
    """Return a number with nine decimals, rounded down."""
    units = value // 10 ** (DECIMALS - 9)
    return f"{'-' if units < 0 else ''}{abs(units) // 10**9}.{abs(units) % 10**9:09d}"


def _whole(word: object) -> int:  # JSON's numbers are read as text, too
    if not isinstance(word, str) or not re.fullmatch(r"[0-9]{1,9}", word):
        raise ValueError(f"expected a whole number, got {word!r:.40}")
    return int(word)


def _listed(value: object, count: int | None = None) -> list[object]:
    if not isinstance(value, list) or (count is not None and len(value) != count):
        raise ValueError(f"expected a list{'' if count is None else f' of {count}'}, got {value!r:.40}")
    return value


def _as_row(value: object) -> Row:
    sensor, index = _listed(value, 2)
    return _whole(sensor) - 1, _whole(index)


class Problem:
    """Sizes of the sensors, whether dummies are allowed, and the cost of each tuple."""

    def __init__(self, sizes: list[int], dummies: bool, costs: dict[tuple[int, ...], int]) -> None:
        self.sizes, self.dummies, self.costs = sizes, dummies, costs
        lines = sorted(f"{indices} {cost}" for indices, cost in costs.items())
        self.digest = hashlib.sha256("\n".join([f"{sizes} {dummies}", *lines]).encode()).hexdigest()
        self.rows = [(s, i) for s, size in enumerate(sizes) for i in range(1, size + 1)]
        # without dummies only the measurements of the smallest sensors must be used
        self.needed = {row for row in self.rows if dummies or sizes[row[0]] == min(sizes)}
        self.unit = math.gcd(*costs.values()) or 1
        every = [(cost, tuple((s, i) for s, i in enumerate(indices) if i)) for indices, cost in costs.items()]
        alone = {rows[0]: cost for cost, rows in every if len(rows) == 1}
        if dummies and len(alone) < len(self.rows):
            raise ValueError("with dummies, each measurement must be listed as a tuple of its own")
        # tuples that can be in a cheapest solution
        self.columns = [
            (c, rows) for c, rows in every if len(rows) == 1 or not dummies or c < sum(alone[r] for r in rows)
        ]


def read_text(path: str) -> str:
    """Return the text of a file, plain or packed by xz."""
    most = min(MOST_BYTES, max(UNPACKED, TIMES * os.path.getsize(path))) if path.endswith(".xz") else MOST_BYTES
    with lzma.open(path) if path.endswith(".xz") else open(path, "rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise ValueError(f"has more than {most} bytes{'' if most == MOST_BYTES else '; if you trust it, unpack it'}")
    return content.decode()


def read_problem(path: str) -> Problem:
    """Read a problem in text form."""
    lines = (line.split() for line in read_text(path).splitlines() if line.strip() and not line.startswith("#"))
    head = [next(lines, [""]) for _ in range(4)]
    if [line[0] for line in head] != ["assoc-problem", "sizes", "dummies", "tuples"] or head[0][1:] != ["1"]:
        raise ValueError("the first lines must be 'assoc-problem 1', 'sizes N ...', 'dummies yes|no', 'tuples N'")
    sizes, dummies, count = list(map(_whole, head[1][1:])), head[2][1:] == ["yes"], _whole("".join(head[3][1:]))
    if not sizes or sum(sizes) > MOST_ROWS or head[2][1:] not in (["yes"], ["no"]):
        raise ValueError(f"expected sizes, up to {MOST_ROWS} measurements in all, and 'dummies yes' or 'dummies no'")
    costs: dict[tuple[int, ...], int] = {}
    for words in lines:
        indices, cost = tuple(map(_whole, words[1:])), number(words[0])
        fits = len(indices) == len(sizes) and not any(map(int.__gt__, indices, sizes))
        if not fits or not (any(indices) if dummies else all(indices)):
            raise ValueError(f"{' '.join(words):.60}: no tuple of these sizes{'' if dummies else ', without dummies'}")
        costs[indices] = min(cost, costs.get(indices, cost))
        count -= 1
    if count:
        raise ValueError("the number of tuples differs from the one in the header")
    return Problem(sizes, dummies, costs)


def read_solution(text: str) -> tuple[list[tuple[int, ...]], str | None]:
    """Return the chosen tuples of a solution in text form, and the cost that it claims."""
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines or lines[0] != ["assoc-solution", "1"]:
        raise ValueError("the first line must be 'assoc-solution 1'")
    claims = [word for line in lines if line[0] == "cost" for word in line[1:] or [""]]
    if len(claims) > 1:
        raise ValueError("expected at most one line 'cost C'")
    return [tuple(map(_whole, line)) for line in lines[1:] if line[0] != "cost"], claims[0] if claims else None


def cost_of(problem: Problem, chosen: list[tuple[int, ...]], claim: object = None) -> int:
    """Return the cost of a choice of tuples; refuse it if it is not a solution, or its cost is not the claimed one."""
    used: set[Row] = set()
    for indices in chosen:
        if indices not in problem.costs:
            raise RefusedError(f"the solution has the tuple {indices}, which is not in the problem")
        for s, i in enumerate(indices):
            if (s, i) in used:
                raise RefusedError(f"the solution uses measurement {i} of sensor {s + 1} twice")
        used |= {(s, i) for s, i in enumerate(indices) if i}
    for s, i in sorted(problem.needed - used):
        raise RefusedError(f"the solution does not use measurement {i} of sensor {s + 1}")
    cost = sum(problem.costs[indices] for indices in chosen)
    if claim is not None and number(claim) != cost:
        raise RefusedError(f"the solution costs {shown(cost)}, not {claim:.60}")
    return cost


def components(every: list[Row], columns: list[Column]) -> list[tuple[list[Row], list[Column]]]:
    """Return the components: connected rows, with their tuples."""
    group = {row: [row] for row in every}
    for _, rows in columns:
        for row in rows[1:]:
            small, large = sorted((group[rows[0]], group[row]), key=len)
            if small is not large:
                large += small
                group.update(dict.fromkeys(small, large))
    found: dict[int, tuple[list[Row], list[Column]]] = {id(rows): (rows, []) for rows in group.values()}
    for column in columns:
        found[id(group[column[1][0]])][1].append(column)
    return list(found.values())


def bounded(columns: list[Column], needed: set[Row], u: dict[Row, int], sides: dict[Row, int]) -> int | None:
    """Return the bound of multipliers, after lowering them; None if a needed row has no tuple."""
    if not needed <= {row for _, rows in columns for row in rows}:
        return None
    for row in u.keys() - needed:
        u[row] = min(u[row], 0)  # a row that may stay uncovered must not raise the bound
    for cost, rows in columns:
        u[rows[0]] += min(cost - sum(u[row] for row in rows), 0)
    return sum(value * sides.get(row, 1) for row, value in u.items())


def cheap(columns: list[Column], u: dict[Row, int], most: int) -> list[Column]:
    """Return the tuples that cost at most ``most`` above their multipliers."""
    return [column for column in columns if column[0] - sum(u[row] for row in column[1]) <= most]


def with_cuts(cuts: object, rows: set[Row], columns: list[Column]) -> tuple[list[Column], dict[Row, int]]:
    """Return the columns with the cuts as further rows, once per pair of the cut's rows; and the cuts' sides."""
    cuts_of, sides = {row: list[Row]() for row in rows}, dict[Row, int]()
    for index, cut in enumerate(_listed(cuts)):
        inside = [_as_row(row) for row in _listed(cut)]
        if len(inside) % 2 == 0 or len({*inside}) != len(inside) or not rows.issuperset(inside) or index >= len(rows):
            raise RefusedError(f"cut {index} does not follow: it needs an odd number of its tree's rows, each once")
        sides[-1, index] = len(inside) // 2
        for row in inside:
            cuts_of[row].append((-1, index))
    longer = []
    for cost, members in columns:
        hits = [cut for row in members for cut in cuts_of[row]]
        pairs = [cut for cut, count in Counter(hits).items() for _ in range(count // 2)]
        longer.append((cost, (*members, *pairs)))
    return longer, sides


def tree_bound(tree: dict[str, object], columns: list[Column], rows: list[Row], needed: set[Row], unit: int) -> int:
    """Return the least bound of a tree's leaves, or its target if that is less."""
    nodes, todo, seen, least = _listed(tree.get("nodes")), [0], {0}, number(tree.get("target")) // unit * unit
    inside, target = set(rows), least
    columns, sides = with_cuts(tree.get("cuts"), inside, columns)
    names, states = [*rows, *sides], {0: (columns, needed & inside)}
    while todo:
        at = todo.pop()
        columns, needed = states.pop(at)
        node = nodes[at] if at < len(nodes) else None
        if not isinstance(node, dict) or len(todo) > DEEPEST:
            raise ValueError(f"a tree lacks node {at}, or is deeper than {DEEPEST}")
        if "multipliers" in node or "pair" not in node:
            values = node.get("multipliers")
            if not isinstance(values, list) or len(values) != len(names):
                raise ValueError(f"node {at} of a tree must have a multiplier for each of its rows and cuts")
            u = dict(zip(names, map(number, values), strict=True))
            bound = bounded(columns, needed, u, sides)
            if bound is None:
                continue
            if "pair" not in node:
                least = min(least, bound)
                continue
            columns = cheap(columns, u, target - unit - bound)  # no solution below the target has the others
        (a, b), children = map(_as_row, _listed(node["pair"], 2)), list(map(_whole, _listed(node.get("children"), 2)))
        new = len({*children}) == 2 and seen.isdisjoint(children) and min(children) > at
        if a == b or not {a, b} <= inside or not new:
            raise ValueError(f"node {at} of a tree must name two rows of it, and two children of its own after it")
        seen.update(children)
        states[children[0]] = [column for column in columns if (a in column[1]) == (b in column[1])], needed | {a, b}
        states[children[1]] = [column for column in columns if not (a in column[1] and b in column[1])], needed
        todo += children
    return least


def proved(problem: Problem, proof: dict[str, object], target: int) -> int:
    """Return the lower bound that a proof gives; it is at most the target, the cost of a solution."""
    if proof.get("problem") != problem.digest:
        raise RefusedError("the proof is for another problem")
    columns, bound, u = problem.columns, None, dict.fromkeys(problem.rows, 0)
    for stage in _listed(proof.get("multipliers")) or [None]:
        by_sensor = zip(_listed(stage, len(problem.sizes)), problem.sizes, strict=True)
        values = [number(value) for listed, size in by_sensor for value in _listed(listed, size)]
        if bound is not None:  # no solution below the target has the columns that the stage before excludes
            columns = cheap(columns, u, target - bound)
        u = dict(zip(problem.rows, values, strict=True))
        bound = bounded(columns, problem.needed, u, {})
        if bound is None:
            return target
    trees: dict[tuple[Row, ...], dict[str, object]] = {}
    for entry in _listed(proof.get("trees")):
        if not isinstance(entry, dict):
            raise ValueError("a tree must have rows and nodes")
        trees[tuple(map(_as_row, _listed(entry.get("rows"))))] = entry
    total = 0
    for rows, inside in components(problem.rows, columns):
        tree, part = trees.pop(tuple(sorted(rows)), None), sum(u[row] for row in rows)
        if tree is not None:
            part = max(part, tree_bound(tree, inside, sorted(rows), problem.needed, problem.unit))
        total += -(-part // problem.unit) * problem.unit
    if trees:
        raise RefusedError("a tree's rows are not those of a component of the problem")
    return min(total, target)


def check(problem: Problem, text: str) -> list[str]:
    """Return the claims that hold, in lines; raise `RefusedError` if one does not."""
    if not text.lstrip().startswith("{"):
        return [f"feasible, cost {shown(cost_of(problem, *read_solution(text)))}"]
    proof = json.loads(text, parse_float=str, parse_int=str)
    if proof.get("format") != "assoc-proof" or proof.get("version") != "1":
        raise ValueError("expected the format 'assoc-proof', version 1")
    chosen = [tuple(map(_whole, _listed(indices))) for indices in _listed(proof.get("tuples"))]
    cost = cost_of(problem, chosen, proof.get("cost"))
    bound = proved(problem, proof, cost)
    if "bound" in proof and bound < number(proof["bound"]):
        raise RefusedError(f"the proof gives the bound {shown(bound)}, not {proof['bound']!r:.60}")
    conclusion = f"proved: no solution costs less than {shown(bound)} (gap {shown(cost - bound)})"
    return [f"feasible, cost {shown(cost)}", conclusion]


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
    except (OSError, ValueError, TypeError, RecursionError, MemoryError, lzma.LZMAError, EOFError) as error:
        print(f"{path}: {getattr(error, 'strerror', None) or error}".splitlines()[0], file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
