"""What long runs found, printed and kept in the result file from which docs/reliability.md takes its figures."""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Sequence

from experiments.common.claims import Claim, load_json, save_json
from experiments.common.command import replaced
from experiments.common.results import print_claims, result_file

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
        path = result_file("reliability")
        known = [c for c in load_json(path) if not c.quantity.startswith(f"{name}: ")] if path.exists() else []
        save_json(path, replaced(known, found), "reliability", 0, _ABOUT)
    return int(any(claim.holds is False for claim in found))
