"""Recorded trajectories: the geometry against independent formulas, resampling, bad files."""

import gzip
import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.recordings.flights.reports import read_flight_reports
from assoc.scene.geodesy import earth_centered, east_north_up
from assoc.simulation import simulate

A, B = 6378137.0, 6356752.314245
"""WGS-84 semi-axes, metres."""


def test_earth_centered_by_the_definition_of_geodetic_coordinates():
    """Going down the normal by the height leads to the ellipsoid, whose gradient there is that normal."""
    rng = np.random.default_rng(1)
    lat, lon = rng.uniform(-1.5, 1.5, 200), rng.uniform(-3.1, 3.1, 200)
    height = rng.uniform(-100, 20_000, 200)
    normal = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    foot = earth_centered(lat, lon, height) - height[:, None] * normal
    axes = np.array([A, A, B])
    np.testing.assert_allclose(((foot / axes) ** 2).sum(axis=1), 1.0, rtol=1e-12)
    gradient = foot / axes**2
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(gradient, normal, atol=1e-12)


def test_plane_agrees_with_the_radii_of_curvature():
    """Near the origin north is M dlat, east is N cos(lat) dlon, and the surface falls by d^2 / 2R."""
    lat, lon = math.radians(51.5), math.radians(-1.2)
    e2 = 1 - (B / A) ** 2
    w = 1 - e2 * math.sin(lat) ** 2
    meridian, prime = A * (1 - e2) / w**1.5, A / math.sqrt(w)
    step = 1e-3
    origin = (lat, lon, 0.0)
    north = east_north_up(np.array([lat + step]), np.array([lon]), np.array([0.0]), origin)[0]
    east = east_north_up(np.array([lat]), np.array([lon + step]), np.array([0.0]), origin)[0]
    np.testing.assert_allclose(north, [0, meridian * step, -meridian * step**2 / 2], atol=0.05)
    across = prime * math.cos(lat) * step
    np.testing.assert_allclose(east, [across, across * step * math.sin(lat) / 2, -(across**2) / prime / 2], atol=0.05)
    up = east_north_up(np.array([lat]), np.array([lon]), np.array([9000.0]), origin)[0]
    np.testing.assert_allclose(up, [0, 0, 9000], atol=1e-6)


TRACKS = """time,icao24,lat,lon,geoaltitude,squawk
100,aa,50.0,0.0,1000,1
120,aa,50.2,0.0,3000,1
110,bb,50.1,0.2,5000,2
120,bb,50.1,0.3,,2
140,bb,50.1,0.4,5000,2
300,bb,50.1,0.5,5000,2
150,,50.1,0.6,5000,2
"""


@pytest.fixture
def tracks(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(TRACKS)
    return str(path)


def test_resampling(tracks):
    scene = simulate("from-tracks", file=tracks, interval=5.0)
    assert scene.times[0] == 100 and scene.times[-1] == 300 and scene.num_scans == 41
    ids = [scene.scan(k).truth_ids.tolist() for k in range(scene.num_scans)]
    assert ids[:6] == [[0], [0], [0, 1], [0, 1], [0, 1], [1]]
    # the report without altitude counts for nothing: bb flies from 110 to 140 s and is back at 300
    assert ids[8] == [1] and ids[9] == [] and ids[39] == [] and ids[40] == [1]
    a = [scene.scan(k).truth_positions[0] for k in range(5)]
    np.testing.assert_allclose(a[2], (a[0] + a[4]) / 2)
    np.testing.assert_allclose(a[1], 0.75 * a[0] + 0.25 * a[4])


def test_columns_by_name(tmp_path):
    path = tmp_path / "other.csv"
    path.write_text("t,who,phi,lambda,h\n0,7,10,179.9,500\n10,7,10,-179.9,500\n")
    columns = {"time": "t", "id": "who", "latitude": "phi", "longitude": "lambda", "altitude": "h"}
    named = {f"{meaning}_column": name for meaning, name in columns.items()}
    scene = simulate("from-tracks", file=str(path), **named)
    # across the date line the two are neighbours
    assert np.linalg.norm(scene.scan(1).truth_positions - scene.scan(0).truth_positions) < 25_000
    with pytest.raises(InvalidInputError, match="no column time or timestamp for the time; it has: t, who"):
        simulate("from-tracks", file=str(path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x00\xff\xfe\x00\x01", "is not a CSV file|no column"),
        (b"time,id,lat,lon,altitude\n", "no row has"),
        (b"time,id,lat,lon,altitude\n0,a,here,3,4\n", "no row has a time, an identity and a position that can be"),
        (b"time,id,lat,lon,altitude\n0,b,99,3,4\n", "no row has a time, an identity and a position that can be"),
        (b"time,id,lat,lon,altitude,heading\n0,a,3,3\n", "no row has"),
        (b"time,id,lat,lon\n0,a,3,3\n", "no column altitude or geoaltitude or baroaltitude"),
        ("time,id,lat,l\x85n\n0,a,3,3\n".encode(), r"it has: time, id, lat, l\\x85n$"),
    ],
)
def test_bad_files(tmp_path, content, message):
    path = tmp_path / "bad.csv"
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match=message) as caught:
        simulate("from-tracks", file=str(path))
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_speeds_in_knots(tmp_path):
    """Knots and feet per minute, and the same in metres per second, are the same flight."""
    rows = ["icao24,time,lat,lon,altitude,velocity,heading,vertrate"]
    knots = list(rows)
    for k in range(12):
        place = f"a,{10 * k},{47 + 0.009 * k},8.0"
        rows.append(f"{place},3000,{200 * 1852 / 3600},0,{600 * 0.3048 / 60}")
        knots.append(f"{place},3000,200,0,600")
    (tmp_path / "si.csv").write_text("\n".join(rows))
    (tmp_path / "kt.csv").write_text("\n".join(knots))
    one = simulate("from-tracks", 1, file=str(tmp_path / "si.csv"), interval=7.0)
    other = simulate("from-tracks", 1, file=str(tmp_path / "kt.csv"), interval=7.0, speed_unit="kt")
    wrong = simulate("from-tracks", 1, file=str(tmp_path / "kt.csv"), interval=7.0)
    for k in range(one.num_scans):
        np.testing.assert_allclose(one.truth.positions[k], other.truth.positions[k], atol=1e-6)
    pairs = zip(one.truth.positions, wrong.truth.positions, strict=True)
    assert any(np.abs(a - b).max(initial=0.0) > 1.0 for a, b in pairs)
    with pytest.raises(InvalidInputError, match="speed_unit: expected 'm/s' or 'kt'"):
        simulate("from-tracks", 1, file=str(tmp_path / "kt.csv"), speed_unit="mph")


def test_reports_as_people_have_them(tmp_path):
    """Names of columns in any spelling, packed, blanks, and a place that cannot be, which is left out and counted."""
    rows = ["Time,ICAO24,LAT,Lon,Geo Altitude", "0,a,47,8,3000", "10,a,947,8,3000", "20,a,NULL,8,3000", "30,a,47.1,8,-"]
    (tmp_path / "t.bin").write_bytes(gzip.compress("\n".join([*rows, "40,a,47.2,8,3000"]).encode()))
    reports, _, notes = read_flight_reports(str(tmp_path / "t.bin"), {})
    assert reports.time.tolist() == [0, 40]
    assert notes["rows left out whose time or position cannot be"] == 1
    assert notes["rows left out, without altitude"] == 1
