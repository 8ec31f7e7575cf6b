"""What is required, and from which version on."""

import pytest

from tests.release.oldest import COMPANIONS, TOOLS, constraints
from tests.release.requirements import Requirement, read


def test_every_requirement_has_an_oldest_version_and_groups_agree():
    found = read()
    assert {one.name for one in found if one.group == "base"} >= {"numpy", "scipy", "numba", "ortools"}
    lines = constraints(found)
    pinned = [line for line in lines if "==" in line]
    assert len(pinned) + len(COMPANIONS) == len(lines) and len(pinned) == len({line.split("==")[0] for line in pinned})
    assert not {line.split("==")[0] for line in lines} & {one.name for one in found if one.group in TOOLS}
    with pytest.raises(ValueError, match="expected one"):
        constraints([Requirement("numpy", "1.26", "base"), Requirement("numpy", "2.0", "test")])
