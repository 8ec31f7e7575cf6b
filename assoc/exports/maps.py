"""Tracks on the earth: latitudes and longitudes of a table, GeoJSON and KML for maps."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import write_json, write_text
from assoc._text.plain import printable
from assoc._text.times import moment
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics import Trajectories, gospa_over_time
from assoc.scene.geodesy import Origin, geodetic
from assoc.scene.scene import Scene

if TYPE_CHECKING:
    import pandas as pd

COORDINATES = ("latitude", "longitude", "altitude")
"""Additional columns for tracks of a scene with an origin: degrees, degrees, metres above the ellipsoid."""

FOLLOWED_WITHIN = 1_000.0
"""Largest distance at which a track follows a target, metres, to find the target followed most."""


UNKNOWN_HEIGHT = 2_000.0
"""Standard deviation of a height, metres, from which maps draw a track on the ground."""


def coordinates(positions: Array, origin: Origin) -> Array:
    """Latitude and longitude in degrees and altitude in metres of positions (n, 3) in a scene's plane, (n, 3)."""
    return geodetic(positions, origin) * [180.0 / np.pi, 180.0 / np.pi, 1.0]


def followed_targets(times: Array, ids: Array, positions: Array, scene: Scene) -> dict[int, str]:
    """Name of the true target that each track followed most; tracks that followed none are left out.

    `times`, `ids` and `positions` are rows of tracks (`TrackTable.arrays`); the scene must have the truth.
    """
    if scene.truth is None:
        return {}
    pairs: dict[int, Counter[int]] = {}
    tracks = Trajectories(times, ids, positions)
    _, values = gospa_over_time(Trajectories.from_scene(scene), tracks, FOLLOWED_WITHIN)
    for gospa in values:
        for target, track in gospa.pairs.tolist():
            pairs.setdefault(int(track), Counter())[int(target)] += 1
    return {track: scene.truth.name_of(found.most_common(1)[0][0]) for track, found in pairs.items()}


def write_map(path: str | os.PathLike[str], tracks: pd.DataFrame) -> None:
    """Write tracks for a map, GeoJSON or KML by the file's extension; it appears whole or not at all.

    Parameters
    ----------
    path : path-like
        Ends in .geojson, .json or .kml.
    tracks : DataFrame
        Columns track_id, time, latitude, longitude, altitude, and target if known.

    Raises
    ------
    InvalidInputError
        Another extension, or tracks without latitudes: their scene has no origin.
    """
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if ending not in (".geojson", ".json", ".kml"):
        raise InvalidInputError(f"{path}: expected a map's name to end in .geojson or .kml")
    if not {*COORDINATES} <= {*tracks.columns}:
        raise InvalidInputError(f"{path}: the tracks have no latitudes: their scene has no origin on the earth")
    if ending == ".kml":
        write_text(path, _kml(tracks))
    else:
        write_json(path, {"type": "FeatureCollection", "features": [_feature(*track) for track in _by_track(tracks)]})


def _by_track(tracks: pd.DataFrame) -> Iterator[tuple[int, str, pd.DataFrame]]:
    for number, rows in tracks.sort_values(["track_id", "time"], kind="stable").groupby("track_id"):
        target = printable(str(rows["target"].iloc[0])) if "target" in rows else ""
        yield int(str(number)), f"track {number}" + (f" ({target})" if target else ""), rows


def _lines(rows: pd.DataFrame) -> list[list[list[float]]]:
    """Longitude, latitude, altitude of each row, split where the track crosses the date line."""
    # tracks of unknown altitude are drawn on the ground
    points = np.round(np.nan_to_num(rows[["longitude", "latitude", "altitude"]].to_numpy(dtype=float)), 7)
    cuts = np.flatnonzero(np.abs(np.diff(points[:, 0])) > 180.0) + 1
    return [part.tolist() for part in np.split(points, cuts)]


def _has_heights(rows: pd.DataFrame) -> bool:
    """Whether the altitudes of a track are known, measured or estimated from several places."""
    sigma = rows["sigma_z"].median() if "sigma_z" in rows else 0.0
    return bool(rows["altitude"].notna().all()) and sigma < UNKNOWN_HEIGHT


def _feature(number: int, name: str, rows: pd.DataFrame) -> dict[str, Any]:
    parts = _lines(rows)
    geometry: dict[str, Any]
    if len(rows) == 1:
        geometry = {"type": "Point", "coordinates": parts[0][0]}
    elif len(parts) == 1:
        geometry = {"type": "LineString", "coordinates": parts[0]}
    else:
        # a line needs at least two points
        parts = [part if len(part) > 1 else part * 2 for part in parts]
        geometry = {"type": "MultiLineString", "coordinates": parts}
    properties: dict[str, Any] = {"name": name, "track_id": number, "times": rows["time"].tolist()}
    if "target" in rows:
        properties["target"] = str(rows["target"].iloc[0])
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _kml(tracks: pd.DataFrame) -> str:
    from xml.etree import ElementTree

    root = ElementTree.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = ElementTree.SubElement(root, "Document")
    for _, name, rows in _by_track(tracks):
        mark = ElementTree.SubElement(document, "Placemark")
        ElementTree.SubElement(mark, "name").text = name
        first, last = rows["time"].iloc[0], rows["time"].iloc[-1]
        ElementTree.SubElement(mark, "description").text = f"{moment(first)} to {moment(last)}, {len(rows)} rows"
        owner = ElementTree.SubElement(mark, "MultiGeometry")
        mode = "absolute" if _has_heights(rows) else "clampToGround"
        for part in _lines(rows):
            line = ElementTree.SubElement(owner, "LineString" if len(part) > 1 else "Point")
            ElementTree.SubElement(line, "altitudeMode").text = mode
            ElementTree.SubElement(line, "coordinates").text = " ".join(",".join(map(str, point)) for point in part)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)
