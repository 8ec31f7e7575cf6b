"""The shared result form of all experiments: what was claimed, what we measured, and whether it holds."""

import datetime
import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from assoc._files.output import write_text

FORMAT = "assoc.claims"
VERSION = 1


@dataclass(frozen=True)
class Claim:
    """One quantity of a paper, and our measurement of it.

    paper: What the paper (or the goal) says; None where it gives no number.
    interval: Confidence interval of ours, low and high.
    band: What is accepted, low and high; an open end is None inside.
    holds: Whether the claim holds. Left out, it is whether ours lies in the band, or None without a band.
    source: Where the paper prints its number or says what is judged (page, table, figure or equation), or "chosen by
        us".
    Raises ValueError: A number that is NaN, or an interval or band whose low end is above its high end.
    """

    quantity: str
    unit: str = ""
    paper: float | None = None
    ours: float = math.nan
    interval: tuple[float, float] | None = None
    band: tuple[float | None, float | None] | None = None
    holds: bool | None = None
    source: str = ""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "ours", float(self.ours))
        if self.paper is not None:
            put(self, "paper", float(self.paper))
        if math.isnan(self.ours) or (self.paper is not None and math.isnan(self.paper)):
            raise ValueError(f"claim {self.quantity!r}: NaN is not a measurement")
        for name in ("interval", "band"):
            ends = getattr(self, name)
            if ends is None:
                continue
            low, high = (None if end is None else float(end) for end in ends)
            if low is not None and high is not None and not low <= high:
                raise ValueError(f"claim {self.quantity!r}: {name} must be (low, high), got ({low}, {high})")
            put(self, name, (low, high))
        if self.holds is None and self.band is not None:
            low, high = self.band
            inside = (low is None or self.ours >= low) and (high is None or self.ours <= high)
            put(self, "holds", inside)
        elif self.holds is not None:
            put(self, "holds", bool(self.holds))


GOAL = "goal chosen by us"


def with_goal(quantity: str, unit: str, ours: float, *, least: float | None = None, most: float | None = None) -> Claim:
    """Return what we measured where a goal of ours says how small or large it may be."""
    return Claim(quantity, unit, ours=ours, band=(least, most), source=GOAL)


def save_json(path: str | Path, claims: Iterable[Claim], experiment: str, seed: int, about: str = "") -> None:
    """Write the claims as JSON, a line each (infinities are refused: they are not JSON); `about` tells the settings."""
    data = {
        "format": FORMAT,
        "version": VERSION,
        "experiment": experiment,
        "seed": seed,
        "date": datetime.date.today().isoformat(),
        "about": " ".join(about.split()),
    }
    rows = ",\n".join(f"    {json.dumps(asdict(claim), allow_nan=False)}" for claim in claims)
    head = json.dumps(data, indent=2).removesuffix("\n}")
    write_text(path, f'{head},\n  "claims": [\n{rows}\n  ]\n}}\n')


def load_json(path: str | Path) -> list[Claim]:
    """Read claims written by `save_json`.

    Raises ValueError: The file is not of this format or of a future version.
    """
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ValueError(f"{path}: not an {FORMAT} file")
    if data.get("version") != VERSION:
        raise ValueError(f"{path}: version {data.get('version')} is not {VERSION}")
    return [Claim(**claim) for claim in data["claims"]]
