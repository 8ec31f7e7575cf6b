"""Several radars' files to a map: positions against geometry of its own, and one line for what is wrong."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from assoc import inspect, live, register, track
from assoc._cli.track.radars_file import read_radars, write_biases
from assoc.errors import InvalidInputError
from assoc.plotting.live import LivePage
from assoc.recordings import Recording, read_plots
from assoc.recordings.on_earth import Bias
from assoc.scene.geodesy import earth_centered
from tests.sizes import sample

pytest.importorskip("pyarrow")
PLACES = {"north": (47.5, 8.0, 450.0), "south": (46.2, 9.0, 600.0)}
TURNS = {"north": 4.8, "south": 5.9}
CODES = (0o4521, 0o2000, 0o7001)


def place_of(aircraft, times):
    """Latitude and longitude in degrees, and metres; at 250 m/s."""
    lat = 46.6 + 0.2 * aircraft + 2.1e-3 * times * (-1) ** aircraft
    return lat, 8.1 + 0.25 * aircraft + 1e-3 * times, np.full_like(times, (10_000.0, 6_000.0, 3_000.0)[aircraft])


def seen_from(radar, where):
    """Slant range and bearing, in the radar's own frame: east and north at its place."""
    lat, lon, height = (np.asarray(one, dtype=float) for one in PLACES[radar])
    away = earth_centered(*(np.radians(where[0]), np.radians(where[1]), where[2])) - earth_centered(
        np.radians(lat), np.radians(lon), height
    )
    p, q = np.radians([lat, lon])
    east = np.array([-np.sin(q), np.cos(q), 0.0])
    north = np.array([-np.sin(p) * np.cos(q), -np.sin(p) * np.sin(q), np.cos(p)])
    return np.linalg.norm(away, axis=-1), np.arctan2(away @ east, away @ north) % (2 * np.pi)


def table(radar, seed, heights=True):
    rng, turn, rows = np.random.default_rng(seed), TURNS[radar], []
    for k in range(30):
        for aircraft in range(3):
            # the antenna points there when it has turned so far
            time = turn * k
            for _ in range(3):
                distance, bearing = seen_from(radar, place_of(aircraft, np.array(time)))
                time = turn * (k + bearing / (2 * np.pi))
            if rng.uniform() < 0.9:
                level = place_of(aircraft, np.array(time))[2] / 30.48
                rows.append((1626098400 + time, distance + rng.normal(0, 40), np.degrees(bearing) + rng.normal(0, 0.05),
                             CODES[aircraft], level if heights and rng.uniform() < 0.9 else np.nan))  # fmt: skip
        bearing = rng.uniform(0, 360)
        rows.append((1626098400 + turn * (k + bearing / 360), rng.uniform(5e3, 1.5e5), bearing, 0, np.nan))
    frame = pd.DataFrame(rows, columns=["time", "rho_m", "theta", "mode3", "altitude_fl"])
    return frame.sort_values("time")


def described(folder, heights=True, **changes):
    table("north", 1, heights).to_csv(folder / "north.csv", index=False)
    table("south", 2, heights).to_parquet(folder / "south.parquet", index=False)
    lines = []
    for name, file in (("north", "north.csv"), ("south", "south.parquet")):
        own = {"name": f'"{name}"', "file": f'"{file}"', "place": list(PLACES[name]), "noise": [40.0, 0.05],
               "detection_probability": 0.9, "false_alarms": 1.0, "reach_km": 200, **changes}  # fmt: skip
        lines += ["[[radar]]", *(f"{key} = {value}" for key, value in own.items() if value is not None), ""]
    (folder / "radars.toml").write_text("\n".join(lines))
    return str(folder / "radars.toml")


@sample("heights", [True, False], every=2)
def test_two_radars_to_a_map(tmp_path, heights, capsys):
    file, out = described(tmp_path, heights), str(tmp_path / "tracks.csv")
    assert track.main([file, "-o", out, "--map", str(tmp_path / "tracks.kml")]) == 0
    found = pd.read_csv(out, dtype={"target": str})
    late = found[found.time > 1626098400 + 60]
    assert sorted(late.target.unique()) == ["2000", "4521", "7001"] and late.track_id.nunique() == 3
    for aircraft, code in enumerate(CODES):
        own = late[late.target == f"{code:04o}"]
        lat, lon, height = place_of(aircraft, own.time.to_numpy() - 1626098400)
        error = np.hypot(111_200 * (own.latitude - lat), 111_200 * np.cos(np.radians(47)) * (own.longitude - lon))
        # neither the other direction of north, two degrees of longitude away, nor slant ranges are an error
        assert np.median(error) < 150.0
        if heights:
            assert np.median(np.abs(own.altitude - height)) < 60.0
    text = (tmp_path / "tracks.kml").read_text()
    assert ("absolute" in text) and "4521" in text and "2021-07-12" in text
    # smoothed, the tracks have their names and are nearer to the aircraft
    assert track.main([file, "-o", out, "--smooth"]) == 0
    smooth = pd.read_csv(out, dtype={"target": str})
    assert set(smooth.target.unique()) >= {"2000", "4521", "7001"}
    own = smooth[(smooth.target == f"{CODES[0]:04o}") & (smooth.time > 1626098400 + 60)]
    lat, lon, _ = place_of(0, own.time.to_numpy() - 1626098400)
    assert np.median(111_200 * np.hypot(own.latitude - lat, np.cos(np.radians(47)) * (own.longitude - lon))) < 100.0
    capsys.readouterr()


def test_asterix_beside_tables(tmp_path, capsys):
    """Its times are of the day, its codes and addresses are kept, and tracks are named by addresses."""
    asterix = pytest.importorskip("assoc.integrations.asterix")
    pytest.importorskip("asterix")
    file = described(tmp_path)
    south = read_plots(tmp_path / "south.parquet")
    addresses = np.where(south.identities > 0, 0x3C6440 + south.identities % 64, 0)
    of_day = replace(south, times=south.times % 86_400, addresses=addresses)
    asterix.write_plots(tmp_path / "south.ast", of_day, (25, 10))
    text = (tmp_path / "radars.toml").read_text().replace('"south.parquet"', '"south.ast"\nradar = "25/10"')
    (tmp_path / "radars.toml").write_text(text)
    assert inspect.main([file]) == 0
    said = capsys.readouterr().out
    assert re.search(r"south: .*2021-07-12 14:00:0.*7\d % with an address", said) and "nothing looks wrong" in said
    sent = tmp_path / "tracks.ast"
    assert track.main([file, "-o", str(tmp_path / "tracks.csv"), "--asterix", str(sent), "-q"]) == 0
    found = pd.read_csv(tmp_path / "tracks.csv", dtype={"target": str, "mode3_oct": str})
    assert {f"{0x3C6440 + code % 64:06x}" for code in CODES} == {*found[found.time > 1626098460].target}
    # both in one order: the category has times of day, addresses, and heights by Mode C as flight levels
    there, here = asterix.read_tracks(sent), found.sort_values("time", kind="stable", ignore_index=True)
    np.testing.assert_allclose(there.time, here.time % 86_400, atol=1 / 128)
    assert there.address_hex.str.lower().fillna("").tolist() == here.address_hex.fillna("").tolist()
    assert there.mode3_oct.fillna("").tolist() == here.mode3_oct.fillna("").tolist()
    named = there[there.address_hex.notna()]
    assert named.barometric.all() and not there[there.address_hex.isna() & there.mode3_oct.isna()].barometric.any()
    np.testing.assert_allclose(there.altitude, here.altitude, atol=4.0)


def test_what_is_understood_and_what_looks_wrong(tmp_path, capsys):
    file = described(tmp_path)
    assert inspect.main([file, "--picture", str(tmp_path / "plots.png")]) == 0
    said = capsys.readouterr().out
    assert re.search(r"north: \d+ plots, 2021-07-12 14:00:0.* a turn 4\.8 s; noise 40 m, 0\.05 deg; reach 200 km", said)
    assert "% with Mode A, 0 % with an address" in said and "nothing looks wrong" in said
    assert (tmp_path / "plots.png").stat().st_size > 20_000
    late = pd.read_csv(tmp_path / "north.csv")
    late.assign(time=late.time + 7200).to_csv(tmp_path / "north.csv", index=False)
    text = (tmp_path / "radars.toml").read_text()
    (tmp_path / "radars.toml").write_text(text.replace("[46.2, 9.0, 600.0]", "[26.2, 9.0, 600.0]\nturn = 7.7"))
    assert inspect.main([file]) == 0
    said = capsys.readouterr().out
    for line in (
        "do not overlap in time",
        "north: sees nothing that another radar sees",
        "once in 5.9 s, not in 7.7 s",
    ):
        assert line in said


def test_live_from_the_same_file(tmp_path, capsys, monkeypatch):
    """Turns and sensors come from it; plots with heights and without are one radar; the page tells how tracks are."""
    file, out, shown = described(tmp_path), tmp_path / "tracks.csv", []

    # what the page is given: a browser would be too late for a replay at once
    def show(page, picture, heard, counts):
        shown.append(
            (picture, heard, [page._row(one, picture.agreements[one.track_id], heard) for one in picture.tracks])
        )

    monkeypatch.setattr(LivePage, "show", show)
    assert live.main([file, "--replay", "0", "-o", str(out), "--page", "0"]) == 0
    # few plots have no height: their sensor has not fallen silent, the antenna is the same; north ends first
    assert re.findall(r"(\S+) has sent nothing since 2021-07-12 (\S{5})", capsys.readouterr().err) == [
        ("north", "14:02")
    ]
    found = pd.read_csv(out)
    late = found[(found.time > 1626098400 + 60) & (found.event == "update")]
    assert late.track_id.nunique() == 3
    for own, height in zip(sorted(late.groupby("track_id").altitude.median()), (3e3, 6e3, 1e4), strict=True):
        assert own == pytest.approx(height, abs=100)
    picture, heard, rows = shown[len(shown) // 2]
    assert [(one.name, one.parts) for one in heard] == [("north", (0, 1)), ("south", (2, 3))] and len(rows) == 3
    for row in rows:
        status, (nis, consistent, hits) = row[8:10]
        assert status in ("confirmed", "coasting") and consistent and 0.1 < nis < 2 and min(hits) >= 8
    assert live.main([file, "--turns", "4,5", "--replay", "0"]) == 2
    assert "--turns: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"file": '"none.csv"'}, "none.csv: no such file"),
        (
            {"file": '"other.csv"'},
            r"no column bearing .* it has: 'time, rho_m, brng.*columns = \{ ... \} of .*radar north",
        ),
        ({"reach_km": 0.5}, "radar north: reach_km: no plot is within 0.5 km"),
        ({"place": None}, r"radar north: place: expected \[latitude, longitude, height\]"),
        ({"place": [147.5, 8.0]}, "radar north: place: expected a latitude within"),
        ({"noise": [40.0]}, r"radar north: noise: expected \[metres, degrees\]"),
        ({"noise": None}, r"radar north: noise: the plots do not .*: give it \(\[100, 0.1\], metres and degrees"),
        ({"turn": -4}, "radar north: turn: expected a number above 0, got -4"),
        ({"units": '"m"'}, "radar north: units: expected a table"),
        ({"plaice": [1, 2]}, "unknown key 'plaice'; did you mean place"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path, changes, message, capsys):
    file = described(tmp_path, **changes)
    (tmp_path / "other.csv").write_text("time,rho_m,brng\n1,2,3\n")
    for program, words in ((inspect, []), (track, ["-o", str(tmp_path / "t.csv")])):
        assert program.main([file, *words]) == 2
        said = capsys.readouterr().err
        assert re.search(message, said), said
        # a line for each radar at fault
        assert all(": error: " in line for line in said.splitlines()) and said.count("\n") <= 2


def turned(file, degrees, metres):
    """The plots of a file as a radar with these errors would give them."""
    north = pd.read_csv(file)
    north["rho_m"], north["theta"] = north["rho_m"] + metres, (north["theta"] + degrees) % 360
    north.to_csv(file, index=False)


def test_biases_are_written_and_taken_off(tmp_path, capsys):
    file = described(tmp_path)
    exact = read_radars(file)
    turned(tmp_path / "north.csv", 0.4, 250.0)
    before = (tmp_path / "radars.toml").read_text()
    assert register.main([file, "--reference", "south", "--components", "range,azimuth", "--write"]) == 0
    said = capsys.readouterr().out
    assert re.search(r"north: ranges are 2\d\d m too long, .*; bearings are 0\.\d+ deg too far clockwise, sub", said)
    after = (tmp_path / "radars.toml").read_text()
    assert [line for line in after.splitlines() if not line.startswith("bias")] == before.splitlines()
    found = read_radars(file)
    assert found.biases[0].bearing == pytest.approx(0.4, abs=0.03) and found.biases[1] == Bias()
    assert found.biases[0].range == pytest.approx(250.0, abs=40.0)
    off = np.abs(np.angle(np.exp(1j * (found.recordings[0].azimuths - exact.recordings[0].azimuths))))
    assert np.degrees(np.median(off)) < 0.03
    # what is left is no bias, and a second run writes nothing else
    assert register.main([file, "--reference", "south", "--components", "range,azimuth", "--write"]) == 0
    assert "stays as it is" in capsys.readouterr().out and (tmp_path / "radars.toml").read_text() == after


def test_biases_add_up():
    """Gains multiply; bearings stay within half a turn."""
    plots = Recording([1.0, 2.0], [1e5, 2e4], [0.3, -2.0])
    first, second = Bias(120.0, 170.0, 3.0, 0.5), Bias(-40.0, 20.0, -1.0, 0.25)
    twice, once = second.off(first.off(plots)), first.and_then(second).off(plots)
    np.testing.assert_allclose(once.ranges, twice.ranges, rtol=1e-12)
    np.testing.assert_allclose(np.exp(1j * once.azimuths), np.exp(1j * twice.azimuths), atol=1e-12)
    assert once.times.tolist() == twice.times.tolist() == [0.25, 1.25] and first.and_then(second).bearing == -170.0


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("bias = 3", "bias: expected a table such as"),
        ("bias = { azimuth = 1.0 }", "bias: unknown key 'azimuth'"),
        ("bias = { range = true }", "bias: range: expected a number, got True"),
    ],
)
def test_biases_that_are_none(tmp_path, capsys, written, said):
    file = described(tmp_path)
    (tmp_path / "radars.toml").write_text((tmp_path / "radars.toml").read_text() + written + "\n")
    assert inspect.main([file]) == 2
    assert said in capsys.readouterr().err


def test_a_description_that_cannot_be_written_stays(tmp_path):
    file = described(tmp_path)
    text = (tmp_path / "radars.toml").read_text() + "[radar.bias]\nrange = 3.0\n"
    (tmp_path / "radars.toml").write_text(text)
    with pytest.raises(InvalidInputError, match="write yourself: bias = { range = 1.0 }; bias = { bearing = 2.5 }"):
        write_biases(file, [Bias(range=1.0), Bias(bearing=2.5)])
    assert (tmp_path / "radars.toml").read_text() == text


def test_nothing_is_right_that_was_compared_with_nothing(tmp_path, capsys):
    file = described(tmp_path)
    turned(tmp_path / "north.csv", -20.0, 0.0)
    assert inspect.main([file]) == 0
    said = capsys.readouterr().out
    found = re.search(r"north: its bearings are (\S+) deg too far counter-clockwise .*bearing = (\S+) }", said)
    assert found and float(found[1]) == pytest.approx(20.0, abs=0.2) == -float(found[2])
    assert "south: its" not in said and "nothing looks wrong" not in said
    # written into the file, it is taken off
    text = (tmp_path / "radars.toml").read_text()
    alone = text.replace("noise = [40.0, 0.05]", "noise = [4.0, 0.05]").split("[[radar]]")[1]
    (tmp_path / "radars.toml").write_text(text.replace("[[radar]]", f"[[radar]]\nbias = {{ bearing = {found[2]} }}", 1))
    assert inspect.main([file]) == 0
    assert "nothing looks wrong\n" in capsys.readouterr().out
    # one radar, whose noise is ten times that declared
    (tmp_path / "radars.toml").write_text(f"[[radar]]{alone}")
    assert inspect.main([file]) == 0
    said = capsys.readouterr().out
    assert "not compared with anything:\n  north: bearings, ranges and times" in said
    assert re.search(r"looks wrong:\n  north: noise: 4 m and 0.05 deg are declared, \d\d\.?\d? m and", said)


@pytest.mark.slow
def test_without_heights_low_targets_have_no_track_and_the_end_says_so(tmp_path, capsys):
    """A drone 1 km away, seen every 10 s: as high as 20 km it would be anywhere."""
    rng, place, rows = np.random.default_rng(3), np.array([-800.0, 900.0]), []
    for turn in range(50):
        place = place + 120.0 * np.array([np.cos(1 + turn / 7), np.sin(1 + turn / 7)])
        bearing = np.arctan2(*place) % (2 * np.pi)
        noise = rng.normal(0, [10.0, 0.17])
        rows.append([10 * (turn + bearing / (2 * np.pi)), np.hypot(*place) + noise[0], np.degrees(bearing) + noise[1]])
        false = rng.uniform(0, 360)
        rows.append([10 * (turn + false / 360), 5000 * rng.random() ** 0.5, false])
    table = pd.DataFrame(sorted(rows), columns=["time_s", "range_m", "bearing_deg"])
    table.assign(bearing_deg=table.bearing_deg % 360).to_csv(tmp_path / "r.csv", index=False)
    text = '[[radar]]\nfile = "r.csv"\nplace = [47, 8, 0]\nnoise = [10, 0.17]\nfalse_alarms = 1\n'
    file, words = tmp_path / "radars.toml", ["-o", str(tmp_path / "t.csv")]
    file.write_text(text)
    assert track.main([str(file), *words]) == 0
    told = capsys.readouterr().out
    assert "0 confirmed tracks" in told and "no track: where targets are low, 'heights = [lowest, highest]'" in told
    assert inspect.main([str(file)]) == 0 and "most plots have no height" in capsys.readouterr().out
    file.write_text("heights = [0, 100]\n" + text)
    assert inspect.main([str(file)]) == 0 and "most plots have no height" not in capsys.readouterr().out
    assert track.main([str(file), *words, "--targets", "drone"]) == 0
    assert "1 confirmed tracks" in capsys.readouterr().out
