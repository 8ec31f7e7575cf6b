"""Constraints for pip that pin each package which the tests need to the oldest version allowed.

python -m tests.release.oldest > constraints.txt      (make test-oldest)
"""

from tests.release.requirements import Requirement, read

TOOLS = ("lint", "docs", "build", "release")
"""Groups that the tests do not need."""
COMPANIONS = ("pyparsing<3.3",)
"""What an old package brings along but cannot be had with in its newest version: matplotlib 3.9 makes it warn."""


def constraints(requirements: list[Requirement]) -> list[str]:
    """Lines ``name==version``.

    Raises
    ------
    ValueError
        Two groups disagree about a package.
    """
    pinned: dict[str, str] = {}
    for one in requirements:
        if one.group in TOOLS:
            continue
        if pinned.setdefault(one.name, one.oldest) != one.oldest:
            raise ValueError(f"{one.name}: oldest versions {pinned[one.name]} and {one.oldest}, expected one")
    return [*(f"{name}=={version}" for name, version in pinned.items()), *COMPANIONS]


if __name__ == "__main__":
    print("\n".join(constraints(read())))
