"""ASTERIX as it is recorded: frames of recorders and captures, editions, feeds received twice, garbage."""

import struct

import numpy as np
import pytest

pytest.importorskip("asterix", reason="libasterix is not installed: pip install 'assoc[asterix]'")

from assoc import asterix2csv, track
from assoc.errors import InvalidInputError
from assoc.integrations.asterix import blocks as asterix_blocks
from assoc.integrations.asterix import read_asterix, read_records, read_tracks, write_plots
from assoc.integrations.asterix.blocks import editions
from assoc.simulation import simulate_recording
from tests.integrations.captures import fragments, ipv4, ipv6, pcap, pcapng, udp

# a report of edition 2.1, as a ground station sent it
OLD = bytes.fromhex(
    "150055f31b395bd3c70414cb014805bb020f657e22fe f6b712506c229480 7e94776d41d301000a07ca00001e01dad3109480"
    "9010c230d9682003a0f00202010502f141d140b5d6ff06d6b7b70c06074805b14291d2"
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Blocks, and the plots in them."""
    folder = tmp_path_factory.mktemp("plots")
    made = simulate_recording("rotating-radar", 1, duration=100.0).recording
    blocks = []
    for rows in np.array_split(np.arange(len(made)), 12):
        write_plots(folder / "plots.ast", made.take(rows), (25, 201))
        blocks.append((folder / "plots.ast").read_bytes())
    (folder / "plots.ast").write_bytes(b"".join(blocks))
    return blocks, read_asterix(folder / "plots.ast").plots[25, 201]


def read(folder, content, **options):
    (folder / "any.name").write_bytes(content)
    return read_asterix(folder / "any.name", **options)


def same(content, plots):
    found = content.plots[25, 201]
    for name in ("times", "ranges", "azimuths", "identities", "altitudes"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plots, name))


ETHERNET, COOKED, COOKED_2 = bytes(12), bytes(14), b"\x08\x00" + bytes(18)
FRAMES = {
    "pcapng": lambda blocks: pcapng([ETHERNET + b"\x08\x00" + ipv4(udp(one)) for one in blocks], 1),
    "pcapng, big": lambda blocks: pcapng([ETHERNET + b"\x08\x00" + ipv4(udp(one)) for one in blocks], 1, ">"),
    "vlan": lambda blocks: pcap([ETHERNET + b"\x81\x00\x00\x07\x08\x00" + ipv4(udp(one)) for one in blocks], 1),
    "cooked": lambda blocks: pcap([COOKED + b"\x08\x00" + ipv4(udp(one)) for one in blocks], 113),
    "cooked v2": lambda blocks: pcap([COOKED_2 + ipv4(udp(one)) for one in blocks], 276),
    "IPv6": lambda blocks: pcap([ipv6(udp(one)) for one in blocks], 101),
    "fragments": lambda blocks: pcap([p for k, one in enumerate(blocks) for p in fragments(udp(one), k, False)], 101),
    "fragments, IPv6": lambda blocks: pcap(
        [p for k, one in enumerate(blocks) for p in fragments(udp(one), k, True)], 12
    ),
    "FINAL": lambda blocks: b"".join(struct.pack(">H", len(b) + 12) + bytes(6) + b + b"\xa5" * 4 for b in blocks),
    "ORADIS": lambda blocks: b"".join(struct.pack(">H", len(b) + 6) + bytes(4) + b for b in blocks),
    "ORADIS in packets": lambda blocks: pcap(
        [
            ipv4(udp(b"".join(struct.pack(">HI", len(b) + 6, 9) + b for b in blocks[k : k + 2])))
            for k in range(0, 12, 2)
        ],
        101,
    ),
}


@pytest.mark.parametrize("kind", FRAMES)
def test_frames(recorded, kind, tmp_path):
    blocks, plots = recorded
    content = read(tmp_path, FRAMES[kind](blocks))
    same(content, plots)
    assert not content.notes


def test_fragments_that_are_lost_are_counted(recorded, tmp_path):
    blocks, plots = recorded
    packets = [part for k, one in enumerate(blocks) for part in fragments(udp(one), k, False)]
    content = read(tmp_path, pcap(packets[1:], 101))
    assert content.notes == {"packets of which parts are missing": 1} and len(content.plots[25, 201]) < len(plots)


def test_a_feed_received_twice_is_one(recorded, tmp_path, capsys):
    blocks, plots = recorded
    twice = [block for pair in zip(blocks, [blocks[0], *blocks[:-1]], strict=True) for block in pair]
    content = read(tmp_path, b"".join(twice))
    same(content, plots)
    told = {"repeated rows left out": sum(content.notes.values())}
    assert content.notes == told and told["repeated rows left out"] > 0.9 * len(plots)
    # and both programs say so, of a file whose name says nothing
    assert asterix2csv.main([str(tmp_path / "any.name"), "-o", str(tmp_path / "rows.csv")]) == 0
    line = f"repeated rows left out: {told['repeated rows left out']}"
    assert line in capsys.readouterr().err
    words = ["-o", str(tmp_path / "t.csv"), "--rotation", "9.5", "--range-noise", "500", "--bearing-noise", "0.1"]
    assert track.main([str(tmp_path / "any.name"), *words]) == 0
    assert line in capsys.readouterr().out


def test_an_edition_that_a_station_still_sends_is_found_and_told(tmp_path):
    content = read(tmp_path, OLD)
    [found] = content.adsb.values()
    assert content.notes == {"data blocks of category 021 read as of edition 2.1": 1}
    assert found.times[0] == pytest.approx(0x94807E / 128) and found.addresses[0] == 0x506C22
    assert np.degrees(content.origin[:2]) == pytest.approx([43.3025, -2.9145], abs=1e-4)
    [row] = read_records(tmp_path / "any.name")
    assert (row["callsign"], row["mode3_oct"], row["sac"], row["sic"]) == ("DLH06V", "3712", 20, 203)


@pytest.mark.parametrize(("edition", "bits"), [("0.23", 23), ("0.26", 25)])
def test_editions_0_of_adsb(edition, bits, tmp_path):
    kind = editions(21)[edition]
    records = [
        kind.cv_record.create({
            "010": (("SAC", 1), ("SIC", 2)), "030": (1000 + k) * 128, "080": 0x3C4591, "145": 4 * 100,
            "130": (("LAT", round(50 / 180 * 2**bits)), ("LON", round((5 + 0.01 * k) / 180 * 2**bits))),
        }) for k in range(5)
    ]  # fmt: skip
    block = kind.create(records).unparse().to_bytes()
    content = read(tmp_path, block)
    assert content.notes == {f"data blocks of category 021 read as of edition {edition}": 1}
    found = content.adsb[1, 2]
    assert found.times.tolist() == [1000, 1001, 1002, 1003, 1004] and found.addresses[0] == 0x3C4591
    assert np.degrees(content.origin[:2]) == pytest.approx([50, 5], abs=1e-4)
    rows = read_records(tmp_path / "any.name")
    assert (rows[4]["longitude_deg"], rows[4]["latitude_deg"]) == pytest.approx((5.04, 50), abs=1e-4)
    assert [row["time"] for row in rows] == found.times.tolist()
    # and it may be said: in the newest edition these are other items
    assert read(tmp_path, block, editions={21: edition}).adsb[1, 2].times[0] == 1000
    with pytest.raises(InvalidInputError, match="1 data blocks of category 021 that cannot be decoded"):
        read(tmp_path, block, editions={21: "2.7"})
    for given, message in (
        ({21: "1.0"}, "category 021: expected one of 2.7, "),
        ({7: "1.0"}, "expected a category of"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            read(tmp_path, block, editions=given)


def test_editions_on_the_command_line(tmp_path, capsys):
    (tmp_path / "a.ast").write_bytes(OLD)
    assert asterix2csv.main([str(tmp_path / "a.ast"), "--edition", "021=2.7"]) == 2
    assert "1 data blocks of category 021 that cannot be decoded" in capsys.readouterr().err
    assert asterix2csv.main([str(tmp_path / "a.ast"), "--edition", "021"]) == 2
    assert "--edition: expected categories and editions, as 021=0.26" in capsys.readouterr().err


def test_no_garbage_as_rows(recorded, tmp_path, capsys):
    """Reports whose bytes decode, but to no time of a day and no place: they are counted and left out."""
    kind = next(iter(editions(21).values()))
    wrong = kind.cv_record.create({
        "010": (("SAC", 9), ("SIC", 9)), "073": 100_000 * 128, "145": 20_000,
        "131": (("LAT", 2**30 * 100 // 180), ("LON", 0)),
    })  # fmt: skip
    block = kind.create([wrong]).unparse().to_bytes()
    (tmp_path / "bad.ast").write_bytes(block)
    assert asterix2csv.main([str(tmp_path / "bad.ast")]) == 2
    out = capsys.readouterr()
    assert not out.out and "1 data blocks of category 021 that cannot be decoded" in out.err
    content = read(tmp_path, block + b"".join(recorded[0]))
    same(content, recorded[1])
    assert not content.adsb and content.notes == {"data blocks of category 021 that cannot be decoded": 1}


def test_a_record_with_values_that_cannot_be_is_left_out(tmp_path):
    kind = next(iter(editions(48).values()))
    times = [100, 104, 90_000, 108, 112]
    records = [
        kind.cv_record.create({"010": (("SAC", 1), ("SIC", 2)), "140": at * 128, "040": (("RHO", 2560), ("THETA", at))})
        for at in times
    ]
    content = read(tmp_path, kind.create(records).unparse().to_bytes())
    assert content.plots[1, 2].times.tolist() == [100, 104, 108, 112]
    assert content.notes == {"rows left out whose time, range or bearing cannot be": 1}


def test_old_editions_of_tracks(tmp_path):
    kind = editions(62)["1.16"]
    one = kind.cv_record.create(
        {"010": (("SAC", 1), ("SIC", 2)), "070": 12_800, "040": 7, "100": (("X", 200), ("Y", 400))}
    )
    (tmp_path / "t.ast").write_bytes(kind.create([one]).unparse().to_bytes())
    assert read_tracks(tmp_path / "t.ast")[["time", "x", "y"]].to_numpy().tolist() == [[100.0, 100.0, 200.0]]


def test_garbage_is_not_tried_in_all_editions_for_ever(tmp_path, monkeypatch):
    """Blocks of many sources that no edition explains: each is tried in all eleven, as long as that is little work."""
    tried = []
    monkeypatch.setattr(asterix_blocks, "decoded", lambda block, name: tried.append(len(block.content)))
    rng, took = np.random.default_rng(0), []
    for count in (100, 400):
        contents = [b"\x80" + rng.bytes(12_000) for _ in range(count)]
        blocks = [b"\x15" + (len(content) + 3).to_bytes(2, "big") + content for content in contents]
        tried.clear()
        with pytest.raises(InvalidInputError, match=f"{count} data blocks of category 021 that cannot be decoded"):
            read(tmp_path, b"".join(blocks))
        took.append(sum(tried))
    assert took[1] - took[0] < 1.1 * 300 * 12_000


def test_tracks_of_edition_0_17(tmp_path):
    """By hand: 010, 070, 040, 105 (24 bits), 100 (1/64 nmi), 060; 136, 180 (speed, heading); 080, 340, 380; 510, RE."""
    record = bytes([0b10111111, 0b00110001, 0b01011001, 0b00100100, 1, 2])
    record += (40_000 * 128).to_bytes(3, "big") + (100).to_bytes(2, "big")
    record += round(47 / 180 * 2**23).to_bytes(3, "big") + round(-8 / 180 * 2**23).to_bytes(3, "big", signed=True)
    record += (640).to_bytes(2, "big") + (-64).to_bytes(2, "big", signed=True) + (0o4521).to_bytes(2, "big")
    record += (1400).to_bytes(2, "big") + (2**14 // 8).to_bytes(2, "big") + (2**14).to_bytes(2, "big")
    # status of two parts, source and code of the last plot, two data blocks of Mode S and the address, a number
    record += bytes([0b11, 0]) + bytes([0b10001000, 1, 2, 0, 7]) + bytes([0b11000000, 2, *range(16)])
    record += bytes.fromhex("3c4591") + bytes([1, 0, 2]) + bytes([3, 9, 9])
    (tmp_path / "old.ast").write_bytes(b"\x3e" + (2 * len(record) + 3).to_bytes(2, "big") + 2 * record)
    notes = {}
    row, again = read_records(tmp_path / "old.ast", notes)
    assert row == again
    assert notes["data blocks of category 062 read as of edition 0.17"] == 1
    assert (row["sac"], row["sic"], row["time"], row["track"], row["mode3_oct"]) == (1, 2, 40_000, 100, "4521")
    assert row["altitude_fl"] == 350
    assert (row["latitude_deg"], row["longitude_deg"]) == pytest.approx((47, -8), abs=2e-5)
    # an eighth of a nautical mile a second, to the east
    found = (row["x_m"], row["y_m"], row["vx_m_s"], row["vy_m_s"])
    assert found == pytest.approx((18_520, -1_852, 231.5, 0), abs=0.25)
    [track, _] = read_tracks(tmp_path / "old.ast").to_dict("records")
    assert (track["x"], track["address_hex"], track["confirmed"]) == (18_520, "3C4591", False)
    # cut anywhere, it is no track
    (tmp_path / "old.ast").write_bytes(b"\x3e" + (len(record) + 2).to_bytes(2, "big") + record[:-1])
    with pytest.raises(InvalidInputError, match="1 data blocks of category 062 that cannot be decoded"):
        read_records(tmp_path / "old.ast")


def test_an_edition_that_is_not_known_is_refused_in_one_line(recorded, tmp_path, capsys):
    """Records that begin as tracks, with an item that no edition has."""
    record = bytes([0b10110001, 1, 1, 1, 0b10000000, 1, 2]) + bytes(8)
    blocks = 20 * [b"\x3e" + (2 * len(record) + 3).to_bytes(2, "big") + 2 * record]
    (tmp_path / "old.ast").write_bytes(b"".join(blocks))
    assert asterix2csv.main([str(tmp_path / "old.ast")]) == 2
    told = capsys.readouterr()
    assert not told.out and told.err.count("\n") == 1
    assert "20 data blocks of category 062 that cannot be decoded" in told.err
    # among others it is counted, and these are read
    (tmp_path / "old.ast").write_bytes(b"".join([*blocks, *recorded[0]]))
    notes = {}
    assert {row["category"] for row in read_records(tmp_path / "old.ast", notes)} == {48}
    assert notes["data blocks of category 062 that cannot be decoded"] == 20


def test_edition_1_of_adsb_has_its_items_where_edition_2_has_them(tmp_path):
    """A report of edition 1.8 by hand: 010, 040, 161, 131; 080, 073; 210, 070, 145."""
    record = bytes([0b11100011, 0b00011001, 0b00011010, 1, 2, 1, 0, 0, 7])
    record += round(47 / 180 * 2**30).to_bytes(4, "big") + round(8 / 180 * 2**30).to_bytes(4, "big")
    record += bytes.fromhex("3c4591") + (40_000 * 128).to_bytes(3, "big") + bytes([2]) + (0o4521).to_bytes(2, "big")
    record += (1400).to_bytes(2, "big")
    (tmp_path / "a.ast").write_bytes(b"\x15" + (len(record) + 3).to_bytes(2, "big") + record)
    [row] = read_records(tmp_path / "a.ast")
    assert (row["time"], row["mode3_oct"], row["address_hex"], row["altitude_fl"]) == (40_000, "4521", "3C4591", 350)
    assert (row["latitude_deg"], row["longitude_deg"]) == pytest.approx((47, 8), abs=1e-6)
