"""The report of a tracker: figures against plain readings of the table."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from assoc.errors import InvalidInputError
from assoc.plotting.report import write_tracking_report
from assoc.scene import Scene, Truth
from assoc.simulation import simulate
from assoc.tracking import MultiSensorTracker, track_scene
from tests.plotting.pages import EVIL, figures_of, parsed, step_of, text_of


def tracks_of(scene):
    """Tracks on the targets, 30 m beside; one that is nobody's, for three scans."""
    rows = [
        {"track_id": 10 + t, "time": time, "x": p[t, 0] + 30.0, "y": p[t, 1], "z": p[t, 2], "hits": k + 1}
        for k, (time, p) in enumerate(zip(scene.times, scene.truth.positions, strict=True))
        for t in range(3)
    ]
    rows += [{"track_id": 99, "time": time, "x": 9e4, "y": 9e4, "z": 0.0, "hits": 1} for time in scene.times[2:5]]
    return pd.DataFrame(rows)


@pytest.fixture(scope="module")
def scene():
    made = simulate("three-radar", 2, scans=30)
    return Scene(made.sensors, made.times, made.measurements, made.region, made.truth, EVIL)


@pytest.fixture(scope="module")
def page(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "tracks.html"
    frame = tracks_of(scene).sample(frac=1.0, random_state=0)
    write_tracking_report(path, frame, scene, settings={"tracker": "none"}, cutoff=100.0, words=["x.npz", EVIL])
    return path


def test_metric_lives_and_paths(page, scene):
    figures = figures_of(page)
    gospa = {one["name"]: one for one in figures["gospa-over-time-cutoff-100-m-0"]["data"]}
    assert gospa["GOSPA"]["x"] == scene.times.tolist() and gospa["missed"]["y"] == [0.0] * 30
    for k in range(30):
        # three errors of 30 m; a false track costs half the square of the cutoff
        squares = 3 * 30.0**2 + (100.0**2 / 2 if 2 <= k < 5 else 0.0)
        assert gospa["GOSPA"]["y"][k] == pytest.approx(np.sqrt(squares), rel=1e-3)
    figure = figures["tracks-over-time-0"]
    for k, truth in enumerate(scene.truth.positions):
        there, targets = step_of(figure, k, "tracks"), step_of(figure, k, "targets")
        assert there["text"] == ["10", "11", "12"] + (["99"] if 2 <= k < 5 else [])
        assert targets["y"] == pytest.approx((1e-3 * truth[:, 1]).tolist(), abs=6e-4)
        assert there["x"][:3] == pytest.approx((1e-3 * (truth[:, 0] + 30.0)).tolist(), abs=6e-4)
        assert len(step_of(figure, k, "measurements")["x"]) == sum(map(len, scene.measurements[k]))
    assert "3 tracks, 3 targets" in figure["layout"]["sliders"][0]["steps"][0]["label"]
    text = text_of(page)
    assert "python -m assoc.track" in text and text.count(EVIL) >= 2 and "100%" in text
    assert sum(tag == "script" for tag, _ in parsed(page).tags) == 1


def test_a_track_counts_at_every_instant_that_it_lives_through(tmp_path):
    """Rows of different tracks at different times: none of them has one at each instant."""
    rng = np.random.default_rng(3)
    rows = [
        {"track_id": number, "time": round(float(time), 3), "x": float(number), "y": 0.0}
        for number in range(12)
        for time in np.sort(rng.uniform(*np.sort(rng.uniform(0.0, 300.0, 2)), 25))
    ]
    frame = pd.DataFrame(rows)
    write_tracking_report(tmp_path / "counts.html", frame)
    (curve,) = figures_of(tmp_path / "counts.html")["number-of-tracks-over-time-0"]["data"]
    assert curve["x"] == sorted({*frame["time"]})
    lives = frame.groupby("track_id")["time"].agg(["min", "max"]).to_numpy()
    assert curve["y"] == [sum(began <= time <= ended for began, ended in lives) for time in curve["x"]]
    # the slider has fewer instants than there are rows' times, and says as many tracks
    write_tracking_report(tmp_path / "long.html", pd.concat([frame.assign(time=frame["time"] + d) for d in (0.0, 0.5)]))
    slider = figures_of(tmp_path / "long.html")["tracks-over-time-0"]["layout"]["sliders"][0]["steps"]
    assert len(slider) <= 300 and not any(": 0 tracks" in step["label"] for step in slider[5:-5])


def test_scans_of_one_time_are_one_instant_of_the_metric(tmp_path, scene):
    twice = Scene(
        scene.sensors, np.repeat(scene.times, 2), [one for one in scene.measurements for _ in range(2)], scene.region,
        Truth(*([one for one in part for _ in range(2)] for part in (scene.truth.target_ids, scene.truth.positions))),
    )  # fmt: skip
    frame, name = tracks_of(scene), "gospa-over-time-cutoff-100-m-0"
    write_tracking_report(tmp_path / "twice.html", pd.concat([frame, frame]), twice, cutoff=100.0)
    write_tracking_report(tmp_path / "once.html", frame, scene, cutoff=100.0)
    assert figures_of(tmp_path / "twice.html")[name] == figures_of(tmp_path / "once.html")[name]
    # each track still follows its target at all of its instants
    assert "100%" in text_of(tmp_path / "twice.html")


def test_tracks_without_truth_and_no_tracks(tmp_path, scene):
    frame = tracks_of(scene)[["track_id", "time", "x", "y"]]
    write_tracking_report(tmp_path / "one.html", frame, name="plots.csv")
    names = {one["name"] for one in figures_of(tmp_path / "one.html")["tracks-over-time-0"]["data"]}
    assert names == {"whole tracks", "sensors", "tracks"} and "GOSPA" not in text_of(tmp_path / "one.html")
    write_tracking_report(tmp_path / "none.html", frame.iloc[:0])
    assert "No track was made" in text_of(tmp_path / "none.html")
    with pytest.raises(InvalidInputError, match="'y' is missing"):
        write_tracking_report(tmp_path / "bad.html", frame.drop(columns="y"))
    for column, value in (("time", np.nan), ("x", np.inf), ("track_id", "first")):
        with pytest.raises(InvalidInputError, match=f"'{column}' must hold finite numbers"):
            write_tracking_report(tmp_path / "bad.html", frame.assign(**{column: value}))
    assert not (tmp_path / "bad.html").exists()


def test_names_uncertainty_and_places_on_the_earth(tmp_path, scene):
    frame = tracks_of(scene).assign(sigma_x=20.0, sigma_y=10.0)
    names = {10: "SWR12", 11: "4521"}
    frame["target"] = [names.get(number, "") for number in frame.track_id]
    write_tracking_report(tmp_path / "named.html", frame, scene)
    first = step_of(figures_of(tmp_path / "named.html")["tracks-over-time-0"], 0, "tracks")
    assert first["text"] == ["SWR12", "4521", "12"] and first["error_x"]["array"] == [0.04] * 3
    assert "SWR12" in text_of(tmp_path / "named.html").partition("Life of the tracks")[2]
    ground = replace(simulate("three-radar", 2, scans=4), origin=(0.82, 0.15, 400.0))
    table = track_scene(MultiSensorTracker.for_scene(ground), ground)[0].to_frame()
    write_tracking_report(tmp_path / "earth.html", table, ground)
    shown = step_of(figures_of(tmp_path / "earth.html")["tracks-over-time-0"], 3, "tracks")["hovertext"]
    last = table[table["time"] == table["time"].max()].sort_values("track_id")
    for text, (lat, lon) in zip(shown, last[["latitude", "longitude"]].to_numpy(), strict=True):
        assert f"{lat:.5f}\u00b0, {lon:.5f}\u00b0" in text
