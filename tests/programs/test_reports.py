"""AIS, ADS-B and x, y as sensors of radars.toml."""

import re

import numpy as np
import pandas as pd
import pytest

from assoc import inspect, register, track
from assoc._cli.track.line_form import LineForm
from assoc._cli.track.plot_lines import parse_line
from assoc._cli.track.radars_file import read_radars
from assoc.recordings.flights.positions import read_positions
from assoc.scene.geodesy import geodetic

PLACE = (50.77, -1.1, 20.0)
ORIGIN = (np.radians(PLACE[0]), np.radians(PLACE[1]), PLACE[2])
BEGIN = 1_452_603_730.0


def ships(times):
    """x, y (6, n, 2) of six ships at seconds (n,), metres."""
    rng = np.random.default_rng(4)
    start, way, speed = rng.uniform(-9e3, 9e3, (6, 2)), rng.uniform(0, 2 * np.pi, 6), rng.uniform(5, 11, 6)
    velocity = speed[:, None] * np.stack([np.cos(way), np.sin(way)], axis=1)
    return start[:, None] + np.asarray(times)[None, :, None] * velocity[:, None]


def ais(path, duration=240):
    """Five of them send their place every 10 s, as dates, knots and degrees; some rows say that nothing is known."""
    rng, rows = np.random.default_rng(1), []
    for ship in range(5):
        times = np.arange(ship, duration, 10.0)
        where = ships(times)[ship] + rng.normal(0, 8.0, (len(times), 2))
        lat, lon, _ = np.degrees(geodetic(np.column_stack([where, np.zeros(len(times))]), ORIGIN)).T
        rows += [(pd.Timestamp(BEGIN + t, unit="s").isoformat(sep=" "), 235_000_100 + ship, a, b, 157.8, 9.1)
                 for t, a, b in zip(times, lat, lon, strict=True)]  # fmt: skip
    rows += [("2016-01-12 13:03:00", 235_000_100, 91.0, 181.0, 0.0, 0.0), rows[3], ("", 235_000_101, 50.7, -1.0, 0, 0)]
    names = ["Time", "MMSI", "Latitude_degrees", "Longitude_degrees", "COG_degrees", "SOG_knots"]
    pd.DataFrame(rows, columns=names).to_csv(path, index=False)


def radar(path, north=0.0, duration=240):
    """A radar on shore that turns in 3 s, north off by some degrees."""
    rng, rows = np.random.default_rng(2), []
    for k in range(duration // 3):
        where = ships([3.0 * k])[:, 0]
        bearing = np.mod(np.arctan2(where[:, 0], where[:, 1]), 2 * np.pi)
        times = 3.0 * (k + bearing / (2 * np.pi))
        where = np.stack([ships([t])[s, 0] for s, t in enumerate(times)])
        seen = rng.random(6) < 0.9
        away = np.hypot(*where.T) + rng.normal(0, 15, 6)
        said = np.degrees(np.arctan2(*where.T) + rng.normal(0, 3e-3, 6)) + north
        rows += np.stack([BEGIN + times, away, np.mod(said, 360)], axis=1)[seen].tolist()
    pd.DataFrame(sorted(rows), columns=["time", "range_m", "bearing"]).to_csv(path, index=False)


def described(folder, north=0.0):
    ais(folder / "ais.csv")
    radar(folder / "shore.csv", north)
    (folder / "radars.toml").write_text(
        f'heights = [0, 40]\n\n[[radar]]\nname = "shore"\nfile = "shore.csv"\nplace = {list(PLACE)}\n'
        "noise = [15.0, 0.17]\nturn = 3.0\n"
        "detection_probability = 0.9\nfalse_alarms = 0.1\n\n"
        '[[reports]]\nname = "AIS"\nfile = "ais.csv"\nnoise = [8.0]\n'
    )
    return str(folder / "radars.toml")


def test_ais_is_read(tmp_path):
    ais(tmp_path / "ais.csv")
    found = read_positions(str(tmp_path / "ais.csv"))
    assert len(found) == 120 and (np.diff(found.times) >= 0).all() and not found.heard.any()
    assert {*found.identities[:, 1].tolist()} == {235_000_100 + ship for ship in range(5)}
    assert found.notes == {
        "reports left out, without time or position": 2,
        "reports left out, repeated": 1,
    }
    own = found.identities[:, 1] == 235_000_102
    off = found.in_scene(ORIGIN)[own, :2] - ships(found.times[own] - BEGIN)[2]
    assert np.sqrt((off**2).mean()) < 12.0 and found.pace == pytest.approx(10.0)


def test_opensky_and_plain_plots(tmp_path):
    """OpenSky says when a position was received, and repeats it; plots in x, y need no origin for themselves."""
    states = ["time,icao24,lat,lon,velocity,squawk,baroaltitude,geoaltitude,lastposupdate"]
    states += [f"{10 * k},3c4591,{47 + 0.01 * k},8.1,250,1174.0,10668,10843.26,{10 * k - 0.5}" for k in range(5)]
    states += ["60,3c4591,47.04,8.1,250,1174.0,10668,,39.5", "60,407a19,47.2,8.2,250,,10668,,59.0"]
    (tmp_path / "sky.csv").write_text("\n".join(states))
    found = read_positions(str(tmp_path / "sky.csv"))
    assert found.times.tolist() == [-0.5, 9.5, 19.5, 29.5, 39.5, 59.0] and found.heard.tolist() == [True] * 5 + [False]
    assert found.identities[0].tolist() == [0o1174, 0x3C4591] and found.places[0, 2] == 10843.26
    (tmp_path / "xy.csv").write_text("when;x;y\n1;100;200\n2;110;n/a\n3;120;220\n")
    found = read_positions(str(tmp_path / "xy.csv"), {"time": "when"})
    assert not found.on_earth and found.in_scene(ORIGIN)[:, :2].tolist() == [[100, 200], [120, 220]]
    with pytest.raises(Exception, match=r"xy.csv: no column lastposupdate or time .* it has: when, x, y"):
        read_positions(str(tmp_path / "xy.csv"))


@pytest.mark.slow
def test_a_radar_beside_ais(tmp_path, capsys):
    """AIS is the reference by which the radar's north is found; tracks have the ships' numbers."""
    file = described(tmp_path, north=1.5)
    found = read_radars(file)
    assert [sensor.name for sensor in found.scene.sensors] == ["shore", "AIS"] and found.references == ("AIS",)
    assert (found.scene.sectors[:, 1] == 0.0).all() and sum(len(z[1]) for z in found.scene.measurements) == 120
    assert inspect.main([file]) == 0
    said = capsys.readouterr().out
    turned = re.search(r"shore: its bearings are (\S+) deg too far clockwise", said)
    assert turned and float(turned[1]) == pytest.approx(1.5, abs=0.1)
    assert "AIS: 120 reports of 5 targets, 2016-01-12" in said and "without altitudes" in said
    assert register.main([file, "--write", "--angle-spread", "1", "--components", "range,azimuth"]) == 0
    assert read_radars(file).biases[0].bearing == pytest.approx(1.5, abs=0.1)
    assert "AIS" not in capsys.readouterr().out
    out = tmp_path / "tracks.csv"
    assert track.main([file, "-o", str(out), "--targets", "ship", "--identity", "use", "-q"]) == 0
    frame = pd.read_csv(out, dtype={"target": str})
    late = frame[frame.time > BEGIN + 90]
    names = late.groupby("track_id").target.first().fillna("")
    assert sorted(names) == ["", *(f"23500010{ship}" for ship in range(5))]
    for ship in range(5):
        own = late[late.target == f"23500010{ship}"]
        error = own[["x", "y"]].to_numpy() - ships(own.time.to_numpy() - BEGIN)[ship]
        assert np.sqrt((error**2).sum(axis=1).mean()) < 40.0


def test_reports_alone_and_lines(tmp_path):
    """Without a radar the frame stands in the middle of the reports; live lines of AIS have latitudes, too."""
    ais(tmp_path / "ais.csv")
    (tmp_path / "only.toml").write_text('[[reports]]\nname = "AIS"\nfile = "ais.csv"\n')
    found = read_radars(str(tmp_path / "only.toml"))
    assert found.shortest == pytest.approx(10.0) and found.scene.num_scans in (47, 48)
    form = LineForm(found.scene)
    header, first = (tmp_path / "ais.csv").read_text().splitlines()[:2]
    assert parse_line(header, found.scene, form) is None
    plot = parse_line(first, found.scene, form)
    assert plot.identity == (0, 235_000_100) and plot.time == BEGIN
    here = [z for scan in range(3) for z in found.scene.scan(scan).measurements[0].tolist()]
    assert np.abs(np.array(here) - plot.values).max(axis=1).min() < 1e-6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[reports]]\nname = "a"\n', "reports a: file: expected the name of a file"),
        ('[[reports]]\nfile = "none.csv"\n', "none.csv"),
        ('[[reports]]\nfile = "ais.csv"\nplace = [1, 2, 3]\n', "unknown key 'place'"),
        ('[[reports]]\nfile = "ais.csv"\nnoise = [1, 2, 3]\n', "noise: expected [metres] or [metres, metres"),
        ('[[reports]]\nfile = "ais.csv"\nunits = { altitude = "km" }\n', "units: expected altitude = one of m, ft, fl"),
        ('heights = [40]\n[[reports]]\nfile = "ais.csv"\n', "heights: expected [lowest, highest] altitude of targets"),
        ('name = "nothing"\n', "expected a table [[radar]] for each radar, or [[reports]]"),
    ],
)  # fmt: skip
def test_bad_reports(tmp_path, capsys, text, said):
    ais(tmp_path / "ais.csv")
    (tmp_path / "bad.toml").write_text(text)
    assert inspect.main([str(tmp_path / "bad.toml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and said in lines[0]
