"""Tracks on the earth: columns, names, GeoJSON and KML, against the positions they were made from."""

import json
import math
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from assoc.errors import AssocWarning, InvalidInputError
from assoc.exports.maps import write_map
from assoc.scene import Scene
from assoc.scene.geodesy import earth_centered, east_north_up, geodetic
from assoc.simulation import simulate
from assoc.tracking import MultiSensorTracker, track_scene


def test_the_way_back_from_the_plane():
    rng = np.random.default_rng(0)
    for origin in [(0.9, -0.03, 0.0), (-1.2, 3.1, 500.0), (math.pi / 2, 0.0, 0.0), (0.0, 0.0, -100.0)]:
        near = rng.uniform(-400e3, 400e3, size=(300, 3)) * [1, 1, 0.1]
        lat, lon, height = geodetic(near, origin).T
        np.testing.assert_allclose(east_north_up(lat, lon, height, origin), near, atol=1e-6)
        # all over the earth, and high above it
        wide = np.stack([rng.uniform(-1.57, 1.57, 300), rng.uniform(-3.14, 3.14, 300), rng.uniform(-1e3, 1e6, 300)])
        found = geodetic(east_north_up(*wide, origin), origin)
        np.testing.assert_allclose(earth_centered(*found.T), earth_centered(*wide), atol=1e-6)
        np.testing.assert_allclose(found[:, 2], wide[2], atol=1e-6)


POINT = ["longitude", "latitude", "altitude"]

FLIGHTS = "time,icao24,callsign,lat,lon,geoaltitude\n" + "".join(
    f"{t},{who},{call},{47.0 + 0.05 * k + 0.002 * t:.6f},{8.0 + 0.06 * k:.6f},{9000 + 300 * k}\n"
    for k, (who, call) in enumerate((("4b1", "SWR1  "), ("4b2", ""), ("3c3", "DLH3")))
    for t in range(0, 130, 5)
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("flights") / "flights.csv"
    path.write_text(FLIGHTS)
    return simulate("from-tracks", 1, file=str(path), interval=5.0)


def test_a_scene_keeps_origin_names_and_notes(scene, tmp_path):
    scene.save(tmp_path / "scene.npz")
    again = Scene.load(tmp_path / "scene.npz")
    # targets are numbered in the order of their identities
    assert again.truth.names == {0: "DLH3", 1: "SWR1", 2: "4b2"} and again.truth.name_of(9) == "9"
    assert again.origin == scene.origin and again.notes == scene.notes == {"rows in the file": 78}
    assert "(4" in again._repr_html_() and "°" in again._repr_html_()
    with np.load(tmp_path / "scene.npz") as file:
        assert int(file["version"]) == 1  # earlier readers leave the new fields out
    plain = simulate("three-radar", scans=2)
    plain.save(tmp_path / "plain.npz")
    with np.load(tmp_path / "plain.npz") as file:
        assert not {"origin", "note_texts", "truth_names"} & {*file.files}
    assert Scene.load(tmp_path / "plain.npz").origin is None


def test_tracks_have_coordinates_and_call_signs(scene, tmp_path):
    table, _ = track_scene(MultiSensorTracker(scene.sensors, region=scene.region), scene)
    frame = table.to_frame()
    assert {*frame["target"]} == {"SWR1", "DLH3", "4b2"}
    last = frame[frame["time"] == frame["time"].max()].set_index("target")
    # where the aircraft are at 125 s
    for k, call in enumerate(("SWR1", "4b2", "DLH3")):
        assert last.loc[call, "latitude"] == pytest.approx(47.0 + 0.05 * k + 0.25, abs=2e-3)
        assert last.loc[call, "longitude"] == pytest.approx(8.0 + 0.06 * k, abs=2e-3)
        assert last.loc[call, "altitude"] == pytest.approx(9000 + 300 * k, abs=250)
    write_map(tmp_path / "map.geojson", frame)
    content = json.loads((tmp_path / "map.geojson").read_text())
    assert content["type"] == "FeatureCollection" and len(content["features"]) == frame["track_id"].nunique()
    for one in content["features"]:
        rows = frame[frame["track_id"] == one["properties"]["track_id"]]
        assert one["geometry"]["type"] == "LineString"
        np.testing.assert_allclose(one["geometry"]["coordinates"], rows[POINT], atol=1e-6)
        assert one["properties"]["target"] == rows["target"].iloc[0]
    write_map(tmp_path / "map.kml", frame)
    root = ElementTree.parse(tmp_path / "map.kml").getroot()
    space = {"k": "http://www.opengis.net/kml/2.2"}
    first = root.find(".//k:coordinates", space).text.split()[0].split(",")
    np.testing.assert_allclose([float(v) for v in first], frame[POINT].iloc[0], atol=1e-6)
    assert len(root.findall(".//k:Placemark", space)) == frame["track_id"].nunique()


def test_a_map_over_the_date_line_and_of_a_point(tmp_path):
    frame = pd.DataFrame({"track_id": [1, 1, 1, 2], "time": [0.0, 1, 2, 0], "latitude": 1.0, "altitude": 5.0})
    frame["longitude"] = [179.9, -179.9, -179.8, 3.0]
    write_map(tmp_path / "a.geojson", frame)
    first, second = (one["geometry"] for one in json.loads((tmp_path / "a.geojson").read_text())["features"])
    assert first["type"] == "MultiLineString" and [len(part) for part in first["coordinates"]] == [2, 2]
    assert second == {"type": "Point", "coordinates": [3.0, 1.0, 5.0]}
    with pytest.raises(InvalidInputError, match="no latitudes"):
        write_map(tmp_path / "b.kml", frame.drop(columns="latitude"))
    with pytest.raises(InvalidInputError, match="end in .geojson or .kml"):
        write_map(tmp_path / "b.shp", frame)


def test_times_units_and_what_is_left_out(tmp_path):
    lines = FLIGHTS.splitlines()
    dates = [lines[0]]
    for line in lines[1:]:
        t, *rest = line.split(",")
        feet = float(rest[-1]) / 0.3048
        dates.append(",".join([f"2024-05-01T12:{int(t) // 60:02d}:{int(t) % 60:02d}Z", *rest[:-1], f"{feet:.3f}"]))
    dates += [dates[1], "2024-05-01T12:00:03Z,4b1,SWR1,47,8,", "2024-05-01T12:00:03Z,,SWR1,47,8,3", ",4b1,SWR1,47,8,3"]
    path, metres = tmp_path / "feet.csv", tmp_path / "metres.csv"
    path.write_text("\n".join(dates))
    metres.write_text(FLIGHTS)
    first = simulate("from-tracks", 1, file=str(path), interval=5.0, altitude_unit="ft")
    same = simulate("from-tracks", 1, file=str(metres), interval=5.0)
    assert first.times[0] == 1714564800.0
    np.testing.assert_allclose(first.times - first.times[0], same.times)
    np.testing.assert_allclose(first.truth.positions[3], same.truth.positions[3], atol=1e-3)
    assert first.notes == {
        "rows in the file": 82,
        "rows left out, without time, latitude or longitude": 1,
        "rows left out, without identity": 1,
        "rows left out, without altitude": 1,
        "rows left out, second report of an aircraft at one instant": 1,
    }
    with pytest.warns(AssocWarning, match="a tenth of all reports lies above 31496 m.*--altitude-unit ft"):
        simulate("from-tracks", 1, file=str(path), interval=5.0)
    path.write_text("\n".join([*dates[:3], "2024-13-01T00:00:00,a,b,1,2,3"]))
    notes = simulate("from-tracks", 1, file=str(path)).notes
    assert notes["rows left out, without time, latitude or longitude"] == 1


def test_parquet(tmp_path):
    pytest.importorskip("pyarrow")
    from io import StringIO

    frame = pd.read_csv(StringIO(FLIGHTS))
    frame.to_parquet(tmp_path / "numbers.parquet")
    frame.assign(time=pd.to_datetime(frame["time"], unit="s", utc=True)).to_parquet(tmp_path / "dates.parquet")
    (tmp_path / "flights.csv").write_text(FLIGHTS)
    scenes = [simulate("from-tracks", 1, file=str(tmp_path / name)) for name in
              ("flights.csv", "numbers.parquet", "dates.parquet")]  # fmt: skip
    for other in scenes[1:]:
        np.testing.assert_allclose(other.times, scenes[0].times)
        np.testing.assert_allclose(other.truth.positions[5], scenes[0].truth.positions[5])
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 and nothing more of that kind")
    with pytest.raises(InvalidInputError, match=r"bad.parquet: is not a Parquet file"):
        simulate("from-tracks", 1, file=str(tmp_path / "bad.parquet"))
