"""ASTERIX: round trips to the last step, bytes that others wrote, cut and hostile files, midnight, a pcap."""

import io
import math
import struct

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("asterix", reason="libasterix is not installed: pip install 'assoc[asterix]'")

from assoc import asterix2csv
from assoc.errors import InvalidInputError
from assoc.integrations.asterix import read_asterix, read_records, read_tracks, write_plots, write_tracks
from assoc.integrations.asterix.blocks import edition, library
from assoc.integrations.asterix.items import value
from assoc.integrations.asterix.parts import AsterixPlots
from assoc.integrations.asterix.tracks import COLUMNS
from assoc.recordings import Recording, read_plots
from assoc.recordings.columns import FLIGHT_LEVEL, NAUTICAL_MILE
from assoc.recordings.recording import joined
from assoc.simulation import simulate_recording


@pytest.fixture(scope="module")
def plots():
    made = simulate_recording("rotating-radar", 1, duration=120.0).recording
    addresses = np.where(made.identities > 0, 0x3C0000 + made.identities, 0)
    return Recording(
        made.times + 36_000.0, made.ranges, made.azimuths, made.identities, made.altitudes, made.garbled,
        addresses=addresses, name="plots",
    )  # fmt: skip


@pytest.fixture
def file(plots, tmp_path):
    write_plots(tmp_path / "plots.ast", plots, (25, 201))
    return tmp_path / "plots.ast"


def test_plots_there_and_back(plots, file, tmp_path):
    content = read_asterix(file)
    assert list(content.plots) == [(25, 201)] and not content.notes
    back = content.plots[25, 201]
    np.testing.assert_allclose(back.times, plots.times, atol=0.5 / 128 + 1e-9)
    np.testing.assert_allclose(back.ranges, plots.ranges, atol=0.5 * NAUTICAL_MILE / 256 + 1e-6)
    turned = np.abs(np.angle(np.exp(1j * (back.azimuths - plots.azimuths))))
    assert turned.max() <= math.pi / 65536 + 1e-12
    np.testing.assert_array_equal(back.identities, plots.identities)
    np.testing.assert_array_equal(back.addresses, plots.addresses)
    np.testing.assert_allclose(back.altitudes, plots.altitudes, atol=FLIGHT_LEVEL / 8 + 1e-6, equal_nan=True)
    # what was read is on the category's steps: from here on round trips are exact
    write_plots(tmp_path / "again.ast", back, (25, 201))
    again = read_asterix(tmp_path / "again.ast").plots[25, 201]
    for name in ("times", "ranges", "azimuths", "identities", "altitudes", "garbled", "addresses"):
        np.testing.assert_array_equal(getattr(again, name), getattr(back, name))


@pytest.mark.slow
def test_parts_of_a_file_are_the_whole(tmp_path):
    """Also with plots that come late, garbled altitudes at the borders, and another radar between."""
    made = simulate_recording("rotating-radar", 3, aircraft=6, duration=2000.0).recording
    pieces = []
    for number, rows in enumerate(np.array_split(np.arange(len(made)), 40)):
        write_plots(tmp_path / "piece.ast", made.take(rows), (1, 1 + (number % 5 == 3)))
        pieces.append((tmp_path / "piece.ast").read_bytes())
    # some 50 s late
    pieces[9], pieces[10] = pieces[10], pieces[9]
    (tmp_path / "plots.ast").write_bytes(b"".join(pieces))
    whole = read_asterix(tmp_path / "plots.ast").plots
    assert whole[1, 1].garbled.any() and not whole[1, 1].garbled.all()
    for radar, one in (("1/1", whole[1, 1]), ("1/2", whole[1, 2])):
        reader = AsterixPlots(tmp_path / "plots.ast", radar, at_once=60)
        parts = [*reader]
        assert len(parts) > 2 and not reader.notes
        together = joined(parts, {}, "")
        for name in ("times", "ranges", "identities", "altitudes", "garbled", "addresses"):
            np.testing.assert_array_equal(getattr(together, name), getattr(one, name))
    for radar, message in ((None, "radar: the file holds plots of 1/1, 1/2; name one"), ("3/4", "name one")):
        with pytest.raises(InvalidInputError, match=message):
            [*AsterixPlots(tmp_path / "plots.ast", radar)]
    # what came later than plots that are given already is counted
    (tmp_path / "late.ast").write_bytes(b"".join([*pieces[5:], pieces[0]]))
    reader = AsterixPlots(tmp_path / "late.ast", "1/1", at_once=60)
    parts = [*reader]
    assert sum(reader.notes.values()) == len(np.array_split(np.arange(len(made)), 40)[0])
    assert any("came more than 300 s late" in what for what in reader.notes)
    assert (np.diff(joined(parts, {}, "").times) >= 0).all()


def test_a_table_of_records(plots, file, tmp_path, capfd):
    """Of a radar: what read_plots makes of the table is the recording; other categories keep their own units."""
    assert asterix2csv.main([str(file), "-o", str(tmp_path / "records.csv"), "-v"]) == 0
    assert f"category 048 of 25/201: {len(plots.times)}" in capfd.readouterr().out
    again, back = read_plots(tmp_path / "records.csv"), read_asterix(file).plots[25, 201]
    for name in ("times", "ranges", "bearings", "altitudes"):
        np.testing.assert_allclose(getattr(again, name), getattr(back, name), atol=1e-9, rtol=1e-12)
    np.testing.assert_array_equal(again.identities, back.identities)
    # by hand: 5 E, 50 N, FL 350, squawk 1234, address 3C4591, callsign DLH9UF
    blocks = edition(21).create([edition(21).cv_record.create({
        "010": (("SAC", 1), ("SIC", 2)), "073": 86_400 * 128 - 1, "145": 1400,
        "131": (("LAT", 2**30 * 50 // 180), ("LON", 2**30 * 5 // 180)),
        "070": (0, ("MODE3A", 0o1234)), "080": 0x3C4591, "170": _six_bits("DLH9UF  "),
    })])  # fmt: skip
    (tmp_path / "adsb.ast").write_bytes(blocks.unparse().to_bytes() + b"\x01\x00\x04x")
    assert asterix2csv.main([str(tmp_path / "adsb.ast")]) == 0
    out, err = capfd.readouterr()
    assert "adsb.ast: data blocks of category 001 that cannot be decoded: 1" in err
    shown = pd.read_csv(io.StringIO(out), dtype={"mode3_oct": str}).iloc[0].dropna().to_dict()
    assert shown.pop("latitude_deg") == pytest.approx(50) and shown.pop("longitude_deg") == pytest.approx(5)
    assert shown == {
        "category": 21, "sac": 1, "sic": 2, "time": 86_400 - 1 / 128, "altitude_fl": 350.0, "mode3_oct": "1234",
        "address_hex": "3C4591", "callsign": "DLH9UF",
    }  # fmt: skip
    write_tracks(tmp_path / "tracks.ast", pd.DataFrame([dict.fromkeys(COLUMNS, 4.0)]))
    [row] = read_records(tmp_path / "tracks.ast")
    assert [row[name] for name in ("track", "time", "x_m", "y_m", "vx_m_s", "vy_m_s")] == [4.0] * 6
    (tmp_path / "empty.ast").write_bytes(b"\x01\x00\x04x")
    assert asterix2csv.main([str(tmp_path / "empty.ast")]) == 2
    assert "empty.ast: holds no ASTERIX records" in capfd.readouterr().err


def _six_bits(letters):
    return sum((ord(letter) & 63) << shift for letter, shift in zip(letters, range(42, -1, -6), strict=True))


def test_a_plot_that_others_encoded(tmp_path):
    """Bytes by hand, from the specification: 10 nmi, 45 degrees, 7777 octal, FL 350, address 3C4591, at 100.5 s."""
    (tmp_path / "one.ast").write_bytes(bytes.fromhex("300015dd8001020032400a0020000fff05783c4591"))
    one = read_asterix(tmp_path / "one.ast").plots[1, 2]
    assert one.times.tolist() == [100.5] and one.ranges.tolist() == [18520.0]
    assert one.azimuths[0] == pytest.approx(math.pi / 4) and one.identities.tolist() == [0o7777]
    assert one.altitudes[0] == pytest.approx(350 * FLIGHT_LEVEL) and one.addresses.tolist() == [0x3C4591]


def test_what_radars_say_of_themselves_and_midnight(tmp_path):
    kind = edition(34)
    who = {"010": (("SAC", 1), ("SIC", 2))}
    day = 86400 * 128
    records = [
        who | {"000": 1, "030": time % day, "041": 512,
               "120": (("HGT", 250), ("LAT", 0x200000), ("LON", (1 << 24) - 0x100000))}
        for time in (day - 512, day, day + 512)
    ]  # fmt: skip
    block = kind.create([kind.cv_record.create(one) for one in records]).unparse().to_bytes()
    late = Recording([86_399.0, 86_401.0, 86_403.0], [1e4] * 3, [0.1] * 3)
    write_plots(tmp_path / "plots.ast", late, (1, 2))
    (tmp_path / "both.ast").write_bytes(block + (tmp_path / "plots.ast").read_bytes())
    content = read_asterix(tmp_path / "both.ast")
    radar = content.radars[1, 2]
    assert radar.norths.tolist() == [86_396.0, 86_400.0, 86_404.0] and radar.rotation == 4.0
    assert radar.place == pytest.approx((math.radians(45.0), math.radians(-22.5), 250.0))
    assert content.plots[1, 2].times.tolist() == [86_399.0, 86_401.0, 86_403.0]


def test_adsb_as_seen_from_a_place(tmp_path):
    kind = edition(21)
    fine = 2**30 / 180.0
    record = kind.cv_record.create(
        {
            "010": (("SAC", 9), ("SIC", 8)), "071": 100 * 128, "080": 0xABCDEF, "145": 4 * 100,
            "131": (("LAT", round(50.1 * fine)), ("LON", round(8.0 * fine))), "070": 0o1234,
        }
    )  # fmt: skip
    (tmp_path / "adsb.ast").write_bytes(kind.create([record]).unparse().to_bytes())
    seen = read_asterix(tmp_path / "adsb.ast", origin=(math.radians(50.0), math.radians(8.0), 0.0)).adsb[9, 8]
    # 0.1 degrees north: 11.12 km, and FL 100 up
    assert seen.ranges[0] == pytest.approx(math.hypot(11_123.0, 3_048.0), rel=2e-3)
    assert seen.azimuths[0] == pytest.approx(math.pi / 2, abs=1e-6)
    assert seen.addresses.tolist() == [0xABCDEF] and seen.identities.tolist() == [0o1234]
    assert seen.altitudes[0] == pytest.approx(3_048.0)


def test_tracks_there_and_back(tmp_path):
    rng = np.random.default_rng(0)
    count = 250
    values = rng.normal(0, 1, (count, 6)) * [5e4, 5e4, 3e3, 200, 200, 10]
    frame = pd.DataFrame(values, columns=[*"xyz", "vx", "vy", "vz"])
    frame.insert(0, "track_id", np.arange(count) + 1)
    frame.insert(1, "time", np.sort(rng.uniform(0, 3600, count)))
    frame["confirmed"] = rng.random(count) < 0.8
    write_tracks(tmp_path / "tracks.ast", frame, (7, 7))
    back = read_tracks(tmp_path / "tracks.ast")
    assert back["track_id"].tolist() == frame["track_id"].tolist()
    assert back["confirmed"].tolist() == frame["confirmed"].tolist()
    steps = {"time": 1 / 128, "x": 0.5, "y": 0.5, "z": 1.905, "vx": 0.25, "vy": 0.25, "vz": 0.03175}
    for name, step in steps.items():
        np.testing.assert_allclose(back[name], frame[name], atol=step / 2 + 1e-9)
    write_tracks(tmp_path / "again.ast", back, (7, 7))
    assert (tmp_path / "again.ast").read_bytes() == (tmp_path / "tracks.ast").read_bytes()
    write_tracks(tmp_path / "again.ast", back.assign(track_id=back["track_id"].astype(float)), (7, 7))
    assert (tmp_path / "again.ast").read_bytes() == (tmp_path / "tracks.ast").read_bytes()
    for x in (1e7, np.nan):
        with pytest.raises(InvalidInputError, match="x does not fit"):
            write_tracks(tmp_path / "far.ast", frame.assign(x=x))
    with pytest.raises(InvalidInputError, match="'vz' is missing"):
        write_tracks(tmp_path / "far.ast", frame.drop(columns="vz"))
    for name, wrong, message in (
        ("time", np.nan, "tracks: time"), ("time", "noon", "tracks: time"), ("track_id", np.nan, "tracks: track_id"),
        ("track_id", "first", "tracks: track_id"), ("track_id", 1.5, "whole numbers in the column 'track_id'"),
        ("vx", "fast", "tracks: expected numbers in the column 'vx'"),
    ):  # fmt: skip
        with pytest.raises(InvalidInputError, match=message):
            write_tracks(tmp_path / "far.ast", frame.assign(**{name: wrong}))
    assert not (tmp_path / "far.ast").exists()


def packet(payload, port=8600):
    udp = struct.pack(">HHHH", port, port, 8 + len(payload), 0) + payload
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 1, 17, 0, bytes(4), bytes(4)) + udp
    return bytes(12) + b"\x08\x00" + ip


def test_blocks_in_the_packets_of_a_pcap(plots, file, tmp_path):
    whole, at = file.read_bytes(), 0
    frames = [bytes(12) + b"\x08\x06" + bytes(28)]
    while at < len(whole):
        length = int.from_bytes(whole[at + 1 : at + 3], "big")
        # some bytes of padding follow, as in short Ethernet frames
        frames.append(packet(whole[at : at + length]) + bytes(4))
        at += length
    for order in "<>":
        head = struct.pack(f"{order}IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
        body = b"".join(struct.pack(f"{order}IIII", 0, 0, len(one), len(one)) + one for one in frames)
        (tmp_path / "plots.pcap").write_bytes(head + body)
        content = read_asterix(tmp_path / "plots.pcap")
        assert len(content.plots[25, 201]) == len(plots) and content.notes == {"packets that are not UDP": 1}


def test_plots_of_older_radars(tmp_path):
    """Bytes by hand: times of day in cycles of 512 s, which service messages complete; the track has no time."""

    def block(category, *records):
        content = bytes.fromhex("".join(records))
        return bytes([category]) + (len(content) + 3).to_bytes(2, "big") + content

    def plot(time):
        return f"fa0102200a0020000fff0578{time * 128 % 65536:04x}"

    def north(time):
        return f"d0010201{time * 128:06x}"

    track = "f380010290" + "00010a0020000fff0578"
    name = tmp_path / "old.ast"
    name.write_bytes(
        block(2, north(36_000))
        + block(1, plot(36_001), track, plot(36_007))
        + block(2, north(36_519))
        + block(1, plot(36_520))
    )
    read = read_asterix(name)
    assert list(read.plots) == [(1, 2)] and read.radars[1, 2].norths.tolist() == [36_000.0, 36_519.0]
    old = read.plots[1, 2]
    assert old.times.tolist() == [36_001.0, 36_007.0, 36_520.0] and set(old.identities) == {0o7777}
    np.testing.assert_allclose(old.ranges, 20 * NAUTICAL_MILE)
    np.testing.assert_allclose(old.azimuths, math.pi / 4)
    np.testing.assert_allclose(old.altitudes, 350 * FLIGHT_LEVEL)
    assert read.notes == {"records of category 001 without time or position": 1}
    rows = read_records(name)
    assert [row.get("time") for row in rows] == [36_000.0, 36_001.0, None, 36_007.0, 36_519.0, 36_520.0]
    assert {key: rows[2][key] for key in ("range_nmi", "bearing_deg", "altitude_fl", "mode3_oct", "track")} == {
        "range_nmi": 20.0, "bearing_deg": 45.0, "altitude_fl": 350.0, "mode3_oct": "7777", "track": 1,
    }  # fmt: skip


@pytest.mark.parametrize(("category", "code", "step", "unit"), [(10, "060", 2**31, 1.0), (20, "070", 2**25, 2.0)])
def test_multilateration(category, code, step, unit, tmp_path):
    kind = edition(category)
    common = {"010": (("SAC", 3), ("SIC", 4)), "140": 128 * 50, code: (0, 0, 0, 0, ("MODE3A", 0o1234)), "220": 0x3C4591}
    there = (("LAT", round(50.0 / 180 * step)), ("LON", round(5.0 / 180 * step)))
    near = (("X", int(-300 * unit) & (0xFFFF if category == 10 else 0xFFFFFF)), ("Y", int(400 * unit)))
    records = [common | {"041": there, "090": (0, 0, ("FL", 4 * 100))}, common | {"042": near}]
    made = kind.create([kind.cv_record.create(one) for one in records]).unparse().to_bytes()
    (tmp_path / "system.ast").write_bytes(made)
    read = read_asterix(tmp_path / "system.ast", origin=(math.radians(50.0), math.radians(5.0), 0.0))
    located, plot = read.multilateration[3, 4], read.plots[3, 4]
    assert located.times.tolist() == plot.times.tolist() == [50.0]
    assert located.ranges[0] == pytest.approx(100 * FLIGHT_LEVEL, abs=1.0)  # straight above the origin
    assert plot.ranges[0] == pytest.approx(500.0) and plot.azimuths[0] == pytest.approx(math.atan2(400.0, -300.0))
    assert located.identities.tolist() == plot.identities.tolist() == [0o1234]
    assert located.addresses.tolist() == plot.addresses.tolist() == [0x3C4591]
    first, second = read_records(tmp_path / "system.ast")
    assert (first["latitude_deg"], first["longitude_deg"]) == pytest.approx((50.0, 5.0), abs=1e-5)
    assert (second["x_m"], second["y_m"], second["address_hex"]) == (-300.0, 400.0, "3C4591")


def test_tracks_with_accuracies_and_places(tmp_path):
    row = dict.fromkeys(COLUMNS, 4.0) | {"sigma_x": 12.1, "sigma_y": 1e9, "sigma_z": 0.0, "confirmed": True}
    row |= {"latitude": -33.25, "longitude": 179.9999999, "altitude": 1905.0}
    frame = pd.DataFrame([row | {"status": "confirmed"}, row | {"time": 8.0, "sigma_z": 40.0, "status": "coasting"}])
    write_tracks(tmp_path / "tracks.ast", frame)
    back = read_tracks(tmp_path / "tracks.ast")
    assert back["sigma_x"].tolist() == [12.5, 12.5] and back["sigma_y"].tolist() == [65535 / 2] * 2  # never too small
    assert np.isnan(back["sigma_z"][0]) and 40.0 <= back["sigma_z"][1] < 42.0
    np.testing.assert_allclose(back["altitude"], 1905.0)
    np.testing.assert_allclose(back[["latitude", "longitude"]], [[-33.25, 179.9999999]] * 2, atol=6e-6)
    content = (tmp_path / "tracks.ast").read_bytes()[3:]
    records = edition(62).cv_uap.parse(library()[0].Bits.from_bytes(content))
    flags = [[value(record, "080", name) for name in ("CNF", "TSB", "TSE", "CST")] for record in records]
    assert flags == [[0, 1, 0, 0], [0, 0, 1, 1]]
