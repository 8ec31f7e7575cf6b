"""A file of category 062 against the specification, by a decoder that shares nothing with the writer.

It reads bytes by EUROCONTROL-SPEC-0149-9, edition 1.17 (2014): the user application profile, lengths, and the weight of
the last bit of each field.
"""

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("asterix", reason="libasterix is not installed: pip install 'assoc[asterix]'")

from assoc.errors import InvalidInputError
from assoc.integrations.asterix import read_tracks, write_tracks

# user application profile: item and octets by field reference number; 0: octets that say whether one follows
PROFILE = {
    1: ("010", 2), 3: ("015", 1), 4: ("070", 3), 5: ("105", 8), 6: ("100", 6), 7: ("185", 4), 8: ("210", 2),
    9: ("060", 2), 10: ("245", 7), 11: ("380", {1: ("ADR", 3), 2: ("ID", 6)}), 12: ("040", 2), 13: ("080", 0),
    15: ("200", 1), 17: ("136", 2), 18: ("130", 2), 19: ("135", 2), 20: ("220", 2),
    27: ("500", {1: ("APC", 4), 2: ("COV", 2), 3: ("APW", 4), 4: ("AGA", 1), 5: ("ABA", 1), 6: ("ATV", 2), 7: ("AA", 2),
                 8: ("ARC", 1)}),
}  # fmt: skip
FEET, DEGREE = 0.3048, 180 / 2**25
# the two numbers of an item, or its number: octets, signed, weight of the last bit
FIELDS = {
    "010": (1, False, 1), "040": (2, False, 1), "070": (3, False, 1 / 128), "100": (3, True, 0.5),
    "105": (4, True, DEGREE), "130": (2, True, 6.25 * FEET), "185": (2, True, 0.25), "220": (2, True, 6.25 * FEET / 60),
    "060": (2, False, 1), "135": (2, False, 25 * FEET), "380.ADR": (3, False, 1), "500.APC": (2, False, 0.5),
    "500.APW": (2, False, DEGREE), "500.AGA": (1, False, 6.25 * FEET), "500.ABA": (1, False, 25 * FEET),
}  # fmt: skip


def marked(content, at):
    """Numbers of the fields that are there: seven in an octet, whose last bit says whether another one follows."""
    found, first = [], 1
    while True:
        octet = content[at]
        found += [first + k for k in range(7) if octet & 0x80 >> k]
        at, first = at + 1, first + 7
        if not octet & 1:
            return found, at


def decoded(content, fields=PROFILE, prefix=""):
    """One record or compound item by its bytes, and how many they were."""
    numbers, at = marked(content, 0)
    items = {}
    for number in numbers:
        name, length = fields[number]
        if isinstance(length, dict):
            inside, used = decoded(content[at:], length, f"{name}.")
            items |= inside
        else:
            used = length or next(k for k in range(len(content)) if not content[at + k] & 1) + 1
            items[prefix + name] = content[at : at + used]
        at += used
    return items, at


def numbers_of(items):
    values = {}
    for name, octets in items.items():
        if name in FIELDS:
            size, signed, weight = FIELDS[name]
            parts = [octets[k : k + size] for k in range(0, len(octets), size)]
            values[name] = [int.from_bytes(part, "big", signed=signed) * weight for part in parts]
    return values


def records(content):
    found, at = [], 0
    while at < len(content):
        category, length = content[at], int.from_bytes(content[at + 1 : at + 3], "big")
        assert category == 62
        end, at = at + length, at + 3
        while at < end:
            items, used = decoded(content[at:end])
            found.append(items)
            at += used
    return found


ROW = {
    "track_id": 70_001, "time": 86_400.0 + 3661.25, "x": -1234.5, "y": 4000.0, "z": 0.0, "vx": -100.25, "vy": 200.0,
    "vz": 1.27, "confirmed": True, "status": "confirmed", "altitude": 350 * 30.48, "barometric": True, "sigma_x": 12.1,
    "sigma_y": 20.0, "sigma_z": 10.0, "latitude": -33.25, "longitude": 179.5, "mode3_oct": "0123",
    "address_hex": "3c4591",
}  # fmt: skip


@pytest.fixture
def file(tmp_path):
    """Tracks in the order of tables, one after the other; of the second less is known, and its height is geometric."""
    later = ROW | {"time": ROW["time"] + 8, "status": "coasting"}
    other = ROW | {"track_id": 9, "time": ROW["time"] + 4, "altitude": 1905.0, "barometric": False, "mode3_oct": "",
                   "address_hex": None, "vx": np.nan, "confirmed": False}  # fmt: skip
    write_tracks(tmp_path / "tracks.ast", pd.DataFrame([ROW, later, other]), (25, 7))
    return tmp_path / "tracks.ast"


def test_each_field_by_hand(file):
    first, other, later = records(file.read_bytes())
    values = numbers_of(first)
    exact = {
        "010": [25, 7], "040": [70_001 - 65_536], "070": [3661.25], "100": [-1234.5, 4000.0], "185": [-100.25, 200.0],
        "220": [1.27], "060": [0o0123], "380.ADR": [0x3C4591], "135": [350 * 30.48],
    }  # fmt: skip
    for name, expected in exact.items():
        assert values.pop(name) == pytest.approx(expected, abs=1e-9), name
    assert values.pop("105") == pytest.approx([-33.25, 179.5], abs=DEGREE / 2)
    assert values.pop("500.APC") == [12.5, 20.0] and values.pop("500.ABA") == [2 * 25 * FEET]  # never too small
    # at 33 degrees south a degree is 110,913 m north and 93,238 m east (NIMA TR 8350.2's ellipsoid)
    (north, east), metres = values.pop("500.APW"), (20.0 / 110_913, 12.1 / 93_238)
    assert 0 <= north - metres[0] < 1.01 * DEGREE and 0 <= east - metres[1] < 1.01 * DEGREE
    assert not values
    # MON SPI MRH SRC CNF, SIM TSE TSB ..., AMA ..., CST ...: each with the bit that says that another octet follows
    assert [one["080"] for one in (first, other, later)] == [
        bytes([0b00000001, 0b00100001, 0b00000001, 0b00000000]),
        bytes([0b00100011, 0b01100001, 0b00000001, 0b00000000]),
        bytes([0b00000001, 0b01000001, 0b00000001, 0b10000000]),
    ]
    values = numbers_of(other)
    assert {"060", "380.ADR", "135", "185", "500.ABA"}.isdisjoint(other) and values["130"] == [1905.0]
    assert values["500.AGA"] == pytest.approx([6 * 6.25 * FEET]) and values["070"] == [3665.25]


def test_there_and_back_and_what_does_not_fit(file, tmp_path):
    back = read_tracks(file)
    assert back["time"].tolist() == [3661.25, 3665.25, 3669.25] and back["barometric"].tolist() == [True, False, True]
    assert back["mode3_oct"].tolist()[::2] == ["0123"] * 2 and back["address_hex"].tolist()[0] == "3C4591"
    assert back["altitude"].tolist() == pytest.approx([350 * 30.48, 1905.0, 350 * 30.48])
    write_tracks(tmp_path / "again.ast", back.drop(columns=["sigma_x", "sigma_y", "sigma_z"]), (25, 7))
    pd.testing.assert_frame_equal(
        read_tracks(tmp_path / "again.ast"), back.drop(columns=["sigma_x", "sigma_y", "sigma_z"])
    )
    for wrong in ({"mode3_oct": "8000"}, {"mode3_oct": "12345"}, {"address_hex": "-3c4591"}, {"address_hex": "x"}):
        with pytest.raises(InvalidInputError, match=f"tracks: {next(iter(wrong))}: expected up to"):
            write_tracks(tmp_path / "bad.ast", pd.DataFrame([ROW | wrong]))
