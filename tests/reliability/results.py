"""What long runs found, printed and kept in `results.json`, from which docs/_tables/reliability.md is made."""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from experiments.common.claims import Claim, load_json, save_json
from experiments.common.results import plain_table, print_claims

FILE = Path(__file__).with_name("results.json")
TABLE = Path(__file__).parents[2] / "docs" / "_tables" / "reliability.md"
_ABOUT = "Long runs of tests/reliability: what was tried, with which command, and the faults found."


def add_ends(parser: argparse.ArgumentParser) -> None:
    """Add the options of when a run ends, and where what it found is kept."""
    parser.add_argument("--minutes", type=float, default=math.inf, help="end after so long; what was done is reported")
    parser.add_argument("--publish", metavar="NAME", help="write what was found as this run of the result file")


def report(
    program: str, published: str | None, counts: Counter[str], faults: Counter[str], claims: Sequence[Claim] = ()
) -> int:
    """Print what was counted and found, and write it as the run ``published``; 1 where something does not hold.

    What was counted under the same name is replaced, the rest of the file stays.
    """
    name = published or program
    words = sys.argv[1:]
    for option in ("--publish", "--minutes"):
        # what names the run, or says when it was cut off, does not change what is tried
        if option in words:
            del words[words.index(option) : words.index(option) + 2]
    command = f"python -m tests.reliability.{program} {' '.join(words)}".strip()
    found = [Claim(f"{name}: {what}", ours=count, source=command) for what, count in counts.items()]
    found += [Claim(f"{name}: faults", ours=sum(faults.values()), band=(None, 0.0), source=command), *claims]
    print_claims(found, name)
    for kind, count in faults.most_common():
        print(f"{count:6d} {kind}")
    if published:
        known = [c for c in load_json(FILE) if not c.quantity.startswith(f"{name}: ")] if FILE.exists() else []
        save_json(FILE, [*known, *found], "reliability", 0, _ABOUT)
        TABLE.write_text(table())
    return int(any(claim.holds is False for claim in found))


def table() -> str:
    """The runs of the result file: command, what was tried, faults."""
    runs: dict[str, list[Claim]] = {}
    for claim in load_json(FILE):
        if claim.source.startswith("python"):
            runs.setdefault(claim.quantity.partition(": ")[0], []).append(claim)
    rows = []
    for name, claims in runs.items():
        tried = [f"{claim.ours:,.0f} {claim.quantity.partition(': ')[2]}" for claim in claims]
        rows.append([name, f"`{claims[0].source}`", ", ".join(tried[:-1]), tried[-1].partition(" ")[0]])
    return plain_table(["run", "command", "tried", "faults"], rows) + "\n"
