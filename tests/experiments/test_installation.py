"""The sizes of an installation, and their table."""

import sys

from experiments import installation
from experiments.common.claims import Claim, save_json
from experiments.pages import measured


def test_packages_are_weighed_with_and_without_bytecode():
    weights = {claim.quantity: claim.ours for claim in installation.weighed(sys.executable)}
    (numba,) = (name.partition(", ")[2] for name in weights if name.startswith("installed, numba "))
    # pip has compiled it
    assert 10.0 < weights[f"without bytecode, {numba}"] < 0.9 * weights[f"installed, {numba}"]
    assert not any(name.startswith("installed, pip ") for name in weights)


def test_the_table_says_what_each_package_is_for_and_what_is_left_without_two(tmp_path):
    assert "experiments.installation" in measured.sizes(tmp_path)
    sizes = {
        "scipy 1": (50.0, 40.0),
        "ortools 9": (30.0, 30.0),
        "protobuf 1": (2.0, 1.0),
        "rich 2": (3.0, 2.0),
        "mdurl 1": (1.0, 0.5),
    }
    kinds = enumerate(("installed", "without bytecode"))
    claims = [Claim(f"{kind}, {name}", "MB", ours=size[k]) for k, kind in kinds for name, size in sizes.items()]
    save_json(tmp_path / "installation.json", claims, "installation", 0)
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in measured.sizes(tmp_path).splitlines()[2:]]
    assert rows[1] == ["ortools 9", measured._FOR["ortools"], "30.0", "30.0"]
    assert [row[0] for row in rows] == ["scipy 1", "ortools 9", "rich 2", "2 others", *(row[0] for row in rows[4:])]
    assert [row[2:] for row in rows[3:]] == [["3.00", "1.50"], ["86.0", "73.5"], ["54.0", "42.5"]]
