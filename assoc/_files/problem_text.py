"""Assignment problems as plain text, which `assoc.check` and other programs read (docs/proofs.md)."""

from __future__ import annotations

import lzma
import os
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import FilePath, write_atomically
from assoc._files.reading import read_lines
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIRST_LINE = "assoc-problem 1"
ENDINGS = (".txt", ".txt.xz")
_LARGEST, _LONGEST_LINE = 500_000_000, 1_000_000
_MOST_INDEX = 2**31


def write_problem_text(
    path: FilePath, tuples: NDArray[np.int32], costs: NDArray[np.float64], sizes: NDArray[np.int32], dummy: bool
) -> None:
    """Write a problem, completely or not at all; costs are the shortest decimals that read back as the same numbers."""
    lines = [FIRST_LINE, "sizes " + " ".join(map(str, sizes.tolist())), f"dummies {'yes' if dummy else 'no'}"]
    lines.append(f"tuples {len(costs)}")
    lines += [f"{cost!r} {' '.join(map(str, row))}" for cost, row in zip(costs.tolist(), tuples.tolist(), strict=True)]
    content = ("\n".join(lines) + "\n").encode()
    if os.fspath(path).endswith(".xz"):
        content = lzma.compress(content, preset=9)
    write_atomically(path, lambda file: file.write(content))


def is_text(path: FilePath) -> bool:
    """Whether a file name is that of a problem as text, compressed or not."""
    return os.fspath(path).endswith(ENDINGS)


def read_problem_text(path: FilePath) -> dict[str, Any]:
    """Read a problem as text: tuples, costs, sizes, dummy."""
    every = read_lines(path, _LONGEST_LINE, _LARGEST)
    rows = (line for line in every if line.strip() and not line.startswith("#"))
    lines = list(islice(rows, 4))
    if not lines or lines[0].split() != FIRST_LINE.split():
        raise InvalidInputError(f"{path}: the first line must be {FIRST_LINE!r}")
    head = dict(zip(("sizes", "dummies", "tuples"), (line.split() for line in lines[1:4]), strict=False))
    if len(head) < 3 or any(words[0] != key for key, words in head.items()):
        raise InvalidInputError(f"{path}: expected the lines 'sizes ...', 'dummies yes' or 'dummies no', 'tuples N'")
    if head["dummies"][1:] not in (["yes"], ["no"]):
        raise InvalidInputError(f"{path}: expected 'dummies yes' or 'dummies no', got {lines[2][:40]!r}")
    try:
        sizes = np.array(head["sizes"][1:], dtype=np.int64)
        count = int(head["tuples"][1])
    except (ValueError, OverflowError, IndexError):
        raise InvalidInputError(f"{path}: sizes and the number of tuples must be whole numbers") from None
    table, first = np.zeros((0, 1 + sizes.size)), list(islice(rows, 1))
    try:
        if first:
            table = np.loadtxt(chain(first, rows), dtype=np.float64, comments=None, ndmin=2)
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(f"{path}: tuples: {str(error).splitlines()[0]:.100}") from None
    if count != len(table):
        raise InvalidInputError(f"{path}: announces {count} tuples and has {len(table)}")
    if table.shape[1] != 1 + sizes.size:
        raise InvalidInputError(f"{path}: tuples: expected a cost and {sizes.size} indices in each line")
    indices = table[:, 1:]
    # check before the cast: NaN, fractions, and numbers beyond the range of indices
    if not ((np.abs(indices) <= _MOST_INDEX) & (indices == np.round(indices))).all():
        raise InvalidInputError(f"{path}: tuples: indices must be whole numbers")
    tuples = indices.astype(np.int64)
    return {"tuples": tuples, "costs": table[:, 0], "sizes": sizes, "dummy": head["dummies"][1] == "yes"}
