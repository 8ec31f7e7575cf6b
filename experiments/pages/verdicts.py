"""How the rows of the coverage tables say whether a claim holds, and what is filled into them."""

from collections.abc import Mapping
from pathlib import Path

from experiments.common.claims import Claim
from experiments.common.results import number

FOLDER = Path(__file__).with_name("papers")
"""The tables as they are written by hand, with {what gives it} where a result has figures."""
HOLDS, NOT, ABSENT = "holds", "does not hold", "absent"
CHANGES = ("new", "verdict", "words")
"""What a later reading of a paper changed of a row: there was none, whether it holds, how that is said."""


def verdict(*claims: Claim) -> str:
    """Whether all of the claims hold."""
    return _counted([claim.holds for claim in claims if claim.holds is not None])


def undecided(claim: Claim) -> str:
    """Whether the claim holds, or that its interval shows neither."""
    return f"{ABSENT}, not shown either way" if claim.holds is None else verdict(claim)


def below_one(claims: list[Claim]) -> str:
    """In how many of the claims the whole interval is below 1."""
    return _counted([claim.interval is not None and claim.interval[1] < 1.0 for claim in claims])


def near(*claims: Claim, share: float = 0.1) -> str:
    """Whether claims are within a share of the paper's numbers, chosen by us."""
    return _counted([abs(c.ours - c.paper) <= share * abs(c.paper) for c in claims if c.paper is not None])


def _counted(held: list[bool]) -> str:
    if all(held):
        return HOLDS
    return f"holds in {sum(held)} of {len(held)}" if any(held) else NOT


def at_the_edge(*claims: Claim) -> str:
    """What the claims are of whose interval goes over an end of what is accepted, the last words of their names."""
    over = []
    for claim in claims:
        (low, high), (least, most) = claim.interval or (0.0, 0.0), claim.band or (None, None)
        if any(end is not None and low < end < high for end in (least, most)):
            over.append(claim.quantity.rpartition(" of ")[2])
    return f"{' and '.join(over)} at the edge" if over else "none at the edge"


def interval(claim: Claim) -> str:
    """The interval of a claim in words."""
    low, high = claim.interval or (claim.ours, claim.ours)
    return f"95 % interval {number(low, 2)} to {number(high, 2)}"


def filled(name: str, found: Mapping[str, object], **more: object) -> str:
    """The table of a paper: its file is an f-string of what was found and of what is above."""
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8").rstrip("\n")
    return str(eval(f"f'''{text}'''", {**globals(), **found, **more}))
