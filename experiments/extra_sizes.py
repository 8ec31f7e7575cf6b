"""What each extra adds to an installation on the disk: its packages here and what they install, bytecode included.

What an installation without extras has already does not count; what several extras share counts for each of them.
"""

import re
from importlib import metadata

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import main

EXTRAS = ("plot", "report", "parquet", "stonesoup", "asterix", "motile", "dask", "tune")


def brought(needs: list[str]) -> set[str]:
    """Installed packages that requirements bring, with all that these require."""
    found: set[str] = set()
    while needs:
        name = re.split(r"[^A-Za-z0-9._-]", needs.pop(), maxsplit=1)[0].lower().replace("_", "-")
        try:
            asked = [] if name in found else metadata.requires(name) or []
        except metadata.PackageNotFoundError:
            continue  # for another system or Python
        found.add(name)
        needs += [need for need in asked if "extra ==" not in need]
    return found


def weight(name: str) -> float:
    """Size of an installed package on the disk, MB."""
    paths = [file.locate() for file in metadata.files(name) or []]
    return sum(path.stat().st_size for path in paths if path.is_file()) / 1e6


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Weigh what each extra adds; nothing is drawn, and nothing is smaller with --quick."""
    needs = metadata.requires("assoc") or []
    base = brought([need for need in needs if "extra ==" not in need])
    claims = []
    for extra in EXTRAS:
        own = [need for need in needs if re.search(f"extra == ['\"]{extra}['\"]", need)]
        added = brought(own) - base
        if added:
            claims.append(Claim(f"extra {extra}", "MB", ours=sum(map(weight, added))))
    return [*claims, Claim("stonesoup without what it requires", "MB", ours=weight("stonesoup"))]


if __name__ == "__main__":
    raise SystemExit(main("extra_sizes", experiment, __doc__))
