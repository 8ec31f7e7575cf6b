"""Judge a solution of an S-D assignment problem: is it feasible, and what does it cost, exactly?

    python verify.py INSTANCE SOLUTION      (both text; the instance may be packed by xz)

This file needs nothing but Python: copy it anywhere. Costs are added as fractions. It prints "feasible COST" and exits
with 0; prints why not and exits with 1; or names what is wrong with a file and exits with 2.

An instance begins with the lines ``assoc-problem 1``, ``sizes N ...`` (measurements of each sensor), ``dummies yes``
or ``dummies no``, ``tuples N``; then a tuple a line: its cost, and an index for each sensor, from 1, 0 where it saw
nothing. A solution begins with ``assoc-solution 1``, may have a line ``cost C``, and has a chosen tuple a line, without
its cost. Every measurement must be in exactly one chosen tuple; without dummies only those of the smallest sensors must
be in one. Lines that begin with # are comments.
"""

import lzma
import re
import sys
from fractions import Fraction

MOST, MOST_ROWS = 200_000_000, 1_000_000
NUMBER = re.compile(r"[+-]?[0-9]{1,60}(\.[0-9]{0,60})?([eE][+-]?[0-9]{1,3})?")
INDEX = re.compile(r"[0-9]{1,9}")


class NoSolutionError(Exception):
    """What is claimed to be a solution is none."""


def lines_of(path: str) -> list[list[str]]:
    """Read the words of each line that is no comment."""
    opened = lzma.open(path, "rb") if path.endswith(".xz") else open(path, "rb")
    with opened as file:
        content = file.read(MOST + 1)
    if len(content) > MOST:
        raise ValueError("is larger than 200 MB")
    text = content.decode("utf-8")
    return [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]


def number(word: str) -> Fraction:
    """Read a decimal number, exactly."""
    if not NUMBER.fullmatch(word):
        raise ValueError(f"expected a decimal number, got {word:.40}")
    return Fraction(word)


def index(word: str) -> int:
    """Read a whole number that may be an index."""
    if not INDEX.fullmatch(word):
        raise ValueError(f"expected a whole number, got {word:.40}")
    return int(word)


def read_instance(path: str) -> tuple[list[int], bool, dict[tuple[int, ...], Fraction]]:
    """Read sizes, whether there are dummies, and the cost of each tuple; of equal tuples the cheaper one counts."""
    lines = lines_of(path)
    if [line[:1] for line in lines[:4]] != [["assoc-problem"], ["sizes"], ["dummies"], ["tuples"]]:
        raise ValueError("the first lines must be 'assoc-problem 1', 'sizes N ...', 'dummies yes|no', 'tuples N'")
    if lines[0][1:] != ["1"] or lines[2][1:] not in (["yes"], ["no"]) or not lines[1][1:]:
        raise ValueError("expected version 1, sizes, and 'dummies yes' or 'dummies no'")
    sizes, dummies = [index(word) for word in lines[1][1:]], lines[2][1:] == ["yes"]
    if sum(sizes) > MOST_ROWS:
        raise ValueError(f"has more than {MOST_ROWS} measurements")
    if [str(len(lines) - 4)] != lines[3][1:]:
        raise ValueError("the number of tuples is not the one that is announced")
    costs: dict[tuple[int, ...], Fraction] = {}
    for line in lines[4:]:
        cost, one = number(line[0]), tuple(index(word) for word in line[1:])
        if len(one) != len(sizes) or any(i > n for i, n in zip(one, sizes, strict=True)) or not any(one):
            raise ValueError(f"{' '.join(line):.60}: no tuple of these sizes")
        if not dummies and not all(one):
            raise ValueError(f"{' '.join(line):.60}: has a dummy, but the instance has none")
        costs[one] = min(cost, costs.get(one, cost))
    return sizes, dummies, costs


def read_solution(path: str) -> tuple[list[tuple[int, ...]], Fraction | None]:
    """Read the chosen tuples, and the cost that is claimed."""
    lines = lines_of(path)
    if not lines or lines[0] != ["assoc-solution", "1"]:
        raise ValueError("the first line must be 'assoc-solution 1'")
    claim = None
    chosen = []
    for line in lines[1:]:
        if line[0] == "cost":
            if claim is not None or len(line) != 2:
                raise ValueError("expected at most one line 'cost C'")
            claim = number(line[1])
        else:
            chosen.append(tuple(index(word) for word in line))
    return chosen, claim


def cost_of(
    sizes: list[int], dummies: bool, costs: dict[tuple[int, ...], Fraction], chosen: list[tuple[int, ...]]
) -> Fraction:
    """Add up what chosen tuples cost; refuse them where they are no solution."""
    used: set[tuple[int, int]] = set()
    for one in chosen:
        if one not in costs:
            raise NoSolutionError(f"tuple {one} is not in the instance")
        for sensor, i in enumerate(one, 1):
            if i and (sensor, i) in used:
                raise NoSolutionError(f"measurement {i} of sensor {sensor} is used twice")
            if i:
                used.add((sensor, i))
    for sensor, size in enumerate(sizes, 1):
        if dummies or size == min(sizes):
            for i in range(1, size + 1):
                if (sensor, i) not in used:
                    raise NoSolutionError(f"measurement {i} of sensor {sensor} is not used")
    return sum((costs[one] for one in chosen), Fraction(0))


def decimal(value: Fraction) -> str:
    """Write a fraction whose denominator divides a power of ten; others with 12 decimals, rounded down."""
    scale = 0
    while scale < 60 and (value * 10**scale).denominator != 1:
        scale += 1
    scale = scale if (value * 10**scale).denominator == 1 else 12
    units = (value * 10**scale).__floor__()
    digits = str(abs(units)).rjust(scale + 1, "0")
    return ("-" if units < 0 else "") + (f"{digits[:-scale]}.{digits[-scale:]}" if scale else digits)


def main(words: list[str]) -> int:
    """Run the program; its exit code."""
    if len(words) != 2:
        print("usage: python -m experiments.sdlib.verify INSTANCE SOLUTION\n\n" + __doc__)
        return 0 if words in (["-h"], ["--help"]) else 2
    path = words[0]
    try:
        instance = read_instance(path)
        path = words[1]
        chosen, claim = read_solution(path)
        cost = cost_of(*instance, chosen)
        if claim is not None and claim != cost:
            raise NoSolutionError(f"it costs {decimal(cost)}, not {decimal(claim)}")
    except NoSolutionError as error:
        print(f"{path}: no solution: {error}")
        return 1
    except (OSError, ValueError, lzma.LZMAError, EOFError, MemoryError) as error:
        print(f"{path}: {getattr(error, 'strerror', None) or error}".splitlines()[0], file=sys.stderr)
        return 2
    print(f"feasible {decimal(cost)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
