"""What is required, from which version on, and under which licence."""

import pytest

from tests.release import licences
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


def test_the_page_lists_what_is_required_with_its_licence():
    assert licences.complaints(licences.PAGE.read_text()) == []


def test_the_comparison_sees_a_page_that_is_wrong():
    text = licences.PAGE.read_text()
    for right, wrong, said in [
        ("| numpy | 2.0.2 |", "| numpy | 1.20 |", "numpy: at least 2.0.2, the page says 1.20"),
        ("| scipy |", "| scipyy |", "scipy: is not listed"),
        ("| always | Apache-2.0 |", "| always | MIT |", "ortools: Apache-2.0"),
    ]:
        assert right in text
        assert any(line.startswith(said) for line in licences.complaints(text.replace(right, wrong, 1)))


def test_nothing_that_users_install_reaches_into_their_programs():
    used = {one.name for one in read() if one.group not in TOOLS and one.group != "test"}
    page = licences.listed(licences.PAGE.read_text())
    assert not [name for name in used if page[name][1] in ("GPL", "?")]
