"""What pyproject.toml requires: one entry for each package, with the oldest version that is allowed."""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# the first version that is not allowed may follow, and a marker: where a package exists for some Pythons alone
_FORM = re.compile(r"([A-Za-z0-9._-]+)>=([0-9]+(?:\.[0-9]+)*)(?:,<[0-9.]+)?(?:; *[^;]+)?")


@dataclass(frozen=True)
class Requirement:
    """A package that is required.

    Attributes
    ----------
    name : str
    oldest : str
        The oldest version allowed.
    group : str
        "base", "build", or the name of the extra.
    """

    name: str
    oldest: str
    group: str


def read() -> list[Requirement]:
    """All requirements, in the order of the file; extras that name other extras of ours add nothing.

    Raises
    ------
    ValueError
        A requirement has another form than ``name>=version`` (then an end, a marker): its oldest version could not
        be tested.
    """
    with open(ROOT / "pyproject.toml", "rb") as file:
        content = tomllib.load(file)
    project = content["project"]
    groups = {"base": project["dependencies"], **project["optional-dependencies"]}
    groups["build"] = content["build-system"]["requires"]
    found = []
    for group, entries in groups.items():
        for entry in entries:
            if entry.startswith(f"{project['name']}["):
                continue
            match = _FORM.fullmatch(entry)
            if match is None:
                raise ValueError(f"pyproject.toml: {entry!r}: expected name>=version")
            found.append(Requirement(match[1], match[2], group))
    return found
