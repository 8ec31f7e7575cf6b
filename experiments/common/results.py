"""The published results: one small file for each experiment, from which the pages take their figures."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from experiments.common.claims import Claim, load_json

RESULTS = Path(__file__).resolve().parents[1] / "results"


def result_file(name: str, folder: Path = RESULTS) -> Path:
    """Path of the result file of ``python -m experiments.NAME``."""
    return folder / f"{name}.json"


class Results:
    """The claims of a result file by their quantity."""

    def __init__(self, name: str, folder: Path = RESULTS) -> None:
        self.path = path = result_file(name, folder)
        self.claims: list[Claim] = load_json(path)
        self.head: dict[str, Any] = {k: v for k, v in json.loads(path.read_text()).items() if k != "claims"}
        self._by_quantity = {claim.quantity: claim for claim in self.claims}

    def __getitem__(self, quantity: str) -> Claim:
        if quantity not in self._by_quantity:
            raise KeyError(f"{self.path}: no claim {quantity!r}")
        return self._by_quantity[quantity]

    def __contains__(self, quantity: str) -> bool:
        return quantity in self._by_quantity

    def starting(self, words: str) -> list[Claim]:
        """Claims whose quantity begins so, at least one."""
        found = [claim for claim in self.claims if claim.quantity.startswith(words)]
        if not found:
            raise KeyError(f"{self.path}: no claim begins with {words!r}")
        return found


def number(value: float, digits: int = 3) -> str:
    """A number with at least so many significant digits, thousands with commas."""
    if abs(value) < 1e-12:
        value = 0.0
    size = abs(value)
    if size and (size < 1e-4 or size >= 1e7):
        return f"{value:.{digits - 1}e}"
    decimals = digits - 1
    while size >= 10 and decimals > 0:
        size, decimals = size / 10, decimals - 1
    while 0 < size < 1 and decimals < 8:
        size, decimals = size * 10, decimals + 1
    return f"{value:,.{decimals}f}"


def as_percent(value: float) -> str:
    """Return a share as a number of percent, three digits; "-" where there is none."""
    if not math.isfinite(value):
        return "-"
    return "0" if abs(value) < 1e-9 else f"{100 * value:.3g}"


def as_time(seconds: float) -> str:
    """Return a time in milliseconds or seconds, three digits."""
    return f"{1e3 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"


def table(
    head: list[str],
    rows: list[list[str]],
    right: Callable[[int], bool] = lambda column: column > 0,
    *,
    tight: bool = False,
) -> str:
    """A table in Markdown; all columns but the first are set to the right unless told otherwise.

    tight: Without blanks in the rule below the head.
    """
    rule = ["---:" if right(column) else "---" for column in range(len(head))]
    lines = [f"| {' | '.join(row)} |" for row in (head, rule, *rows)]
    lines[1] = lines[1].replace(" ", "") if tight else lines[1]
    return "\n".join(lines)


def plain_table(head: list[str], rows: list[list[str]]) -> str:
    """A table whose columns are all set to the left."""
    return table(head, rows, lambda column: False, tight=True)


def print_claims(claims: Sequence[Claim], title: str) -> None:
    """Print the claims as a table on stdout."""

    def ends(pair: tuple[float | None, float | None] | None) -> str:
        low, high = (None if end is None else f"{end:.4g}" for end in pair or (None, None))
        if low is None or high is None:
            return f">= {low}" if low is not None else f"<= {high}" if high is not None else "-"
        return f"{low} .. {high}"

    rows = [
        [c.quantity, c.unit, "-" if c.paper is None else f"{c.paper:.4g}", f"{c.ours:.4g}", ends(c.interval),
         ends(c.band), {True: "yes", False: "no", None: "-"}[c.holds], c.source]
        for c in claims
    ]  # fmt: skip
    head = ["quantity", "unit", "paper", "ours", "interval", "accepted band", "holds", "source"]
    print(f"{title}\n\n{table(head, rows, lambda column: 1 < column < 6)}")
