"""The report of a tracker: figures against plain readings of the table, and the page in a browser."""

import numpy as np
import pandas as pd
import pytest

from assoc.errors import InvalidInputError
from assoc.plotting.report import write_tracking_report
from assoc.scene import Scene, Truth
from assoc.simulation import simulate
from experiments.common.browser import DESKTOP, PHONE, complaints, in_time, press, screenshot, show
from tests.plotting.test_association_report import EVIL, data_of, parsed
from tests.running import here


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
    data = data_of(page)
    gospa = data["gospa"]
    assert gospa["times"] == scene.times.tolist() and gospa["missed"] == [0.0] * 30
    for k in range(30):
        # three errors of 30 m; a false track costs half the square of the cutoff
        squares = 3 * 30.0**2 + (100.0**2 / 2 if 2 <= k < 5 else 0.0)
        assert gospa["distance"][k] == pytest.approx(np.sqrt(squares), rel=1e-3)
    assert [one["id"] for one in data["tracks"]] == [10, 11, 12, 99] and len(data["truth"]) == 3
    assert data["tracks"][3]["t"] == scene.times[2:5].tolist()
    assert data["truth"][1]["x"] == pytest.approx([p[1, 0] for p in scene.truth.positions], abs=0.51)
    text = " ".join(parsed(page).text)
    assert "python -m assoc.track" in text and text.count(EVIL) >= 2 and "100%" in text
    assert sum(tag == "script" for tag, _ in parsed(page).tags) == 3


def test_every_row_stands_at_an_instant_of_the_slider(tmp_path):
    """Times of thirds of a second are rounded alike wherever they stand; a score that is not known is not shown."""
    scene = simulate("three-radar", 2, scans=5, interval=1.0 / 3.0)
    write_tracking_report(tmp_path / "thirds.html", tracks_of(scene).assign(score=np.nan), scene)
    data = data_of(tmp_path / "thirds.html")
    assert len(data["instants"]) == 5
    for one in [*data["tracks"], *data["truth"]]:
        assert {*one["t"]} <= {*data["instants"]}
    assert [one["t"] for one in data["measured"]] == data["instants"]
    assert "score" not in " ".join(parsed(tmp_path / "thirds.html").text)


def test_scans_of_one_time_are_one_instant_of_the_metric(tmp_path, scene):
    twice = Scene(
        scene.sensors, np.repeat(scene.times, 2), [one for one in scene.measurements for _ in range(2)], scene.region,
        Truth(*([one for one in part for _ in range(2)] for part in (scene.truth.target_ids, scene.truth.positions))),
    )  # fmt: skip
    frame = tracks_of(scene)
    write_tracking_report(tmp_path / "twice.html", pd.concat([frame, frame]), twice, cutoff=100.0)
    write_tracking_report(tmp_path / "once.html", frame, scene, cutoff=100.0)
    assert data_of(tmp_path / "twice.html")["gospa"] == data_of(tmp_path / "once.html")["gospa"]
    # each track still follows its target at all of its instants
    assert "100%" in " ".join(parsed(tmp_path / "twice.html").text)


def test_tracks_without_truth_and_no_tracks(tmp_path, scene):
    frame = tracks_of(scene)[["track_id", "time", "x", "y"]]
    write_tracking_report(tmp_path / "one.html", frame, name="plots.csv")
    data = data_of(tmp_path / "one.html")
    assert data["gospa"]["times"] == [] and data["truth"] == [] and len(data["tracks"]) == 4
    assert "GOSPA" not in " ".join(parsed(tmp_path / "one.html").text)
    write_tracking_report(tmp_path / "none.html", frame.iloc[:0])
    assert "No track was made" in " ".join(parsed(tmp_path / "none.html").text)
    with pytest.raises(InvalidInputError, match="'y' is missing"):
        write_tracking_report(tmp_path / "bad.html", frame.drop(columns="y"))
    for column, value in (("time", np.nan), ("x", np.inf), ("track_id", "first")):
        with pytest.raises(InvalidInputError, match=f"'{column}' must hold finite numbers"):
            write_tracking_report(tmp_path / "bad.html", frame.assign(**{column: value}))
    assert not (tmp_path / "bad.html").exists()


def test_long_recordings_are_thinned(tmp_path):
    count = 200_000
    frame = pd.DataFrame({"track_id": np.arange(count) % 50, "time": np.arange(count) * 0.1})
    frame = frame.assign(x=np.sin(frame["time"]) * 1e5, y=np.cos(frame["time"]) * 1e5)
    write_tracking_report(tmp_path / "long.html", frame)
    assert (tmp_path / "long.html").stat().st_size < 8_000_000
    assert data_of(tmp_path / "long.html")["tracks"][7]["t"][-1] == pytest.approx(frame["time"][count - 50 + 7])


@pytest.mark.slow
def test_the_program_writes_it(tmp_path):
    simulate("three-radar", 2, scans=6).save(tmp_path / "scene.npz")
    words = ["scene.npz", "-o", "tracks.csv", "--report", "tracks.html"]
    done = here("assoc.track", *words, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    frame = pd.read_csv(tmp_path / "tracks.csv")
    data = data_of(tmp_path / "tracks.html")
    assert {one["id"] for one in data["tracks"]} == {*frame["track_id"]} and len(data["instants"]) == 6
    assert "python -m assoc.track " + " ".join(words) in " ".join(parsed(tmp_path / "tracks.html").text)


@pytest.mark.slow
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_it_works_in_a_browser(browser, page, pictures, size):
    show(browser, page, size)
    assert browser.execute_script("return document.documentElement.dataset.ready") == "yes"
    assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    assert browser.find_element("tag name", "h1").text == EVIL
    found = "return document.getElementById('scene-plot').data.find((t) => t.name === 'tracks').text"
    assert browser.execute_script(found) == ["10", "11", "12"]
    press(browser, browser.find_elements("css selector", "#track-table tbody tr")[3])
    # a track that is not there any more takes the slider to its beginning
    assert browser.execute_script("return document.getElementById('slider').value") == "2"
    assert browser.execute_script(found) == ["10", "11", "12", "99"]
    press(browser, browser.find_element("id", "after"))
    assert "t = 3 s" in browser.find_element("id", "slider-label").text
    screenshot(browser, pictures / f"tracks-{size[0]}.png")
    assert complaints(browser) == []


@pytest.mark.slow
def test_a_crowd_fills_the_view(browser, tmp_path):
    """With hundreds of tracks the view is theirs, not that of the sensors around them, and no legend lists them all."""
    scene = simulate("crowd", 0, targets=100, scans=3, sensor="radar", width=20_000.0)
    truth = scene.truth
    rows = [
        {"track_id": t, "time": time, "x": p[t, 0], "y": p[t, 1], "z": p[t, 2], "altitude": p[t, 2]}
        for time, p in zip(scene.times, truth.positions, strict=True)
        for t in range(100)
    ]
    write_tracking_report(tmp_path / "crowd.html", pd.DataFrame(rows), scene)
    show(browser, tmp_path / "crowd.html")
    layout = "return document.getElementById('scene-plot').layout"
    low, high = browser.execute_script(f"{layout}.yaxis.range")
    assert high - low < 1.6 * 20.0 < 0.001 * np.ptp([sensor.position[1] for sensor in scene.sensors])
    last = "return document.getElementById('altitude-plot').layout?.showlegend ?? null"
    assert in_time(lambda: browser.execute_script(last) is not None)
    assert browser.execute_script(last) is False
    assert complaints(browser) == []


def test_tracks_are_called_by_their_names(tmp_path, scene):
    frame = tracks_of(scene)
    names = {10: "SWR12", 11: "4521"}
    frame["target"] = [names.get(number, "") for number in frame.track_id]
    write_tracking_report(tmp_path / "named.html", frame, scene)
    assert [one.get("target") for one in data_of(tmp_path / "named.html")["tracks"]] == ["SWR12", "4521", None, None]
    text = " ".join(parsed(tmp_path / "named.html").text)
    assert "SWR12" in text and "name" in text
    write_tracking_report(tmp_path / "nameless.html", tracks_of(scene), scene)
    assert " name " not in " ".join(parsed(tmp_path / "nameless.html").text).partition("Life of the tracks")[2]


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_on_paper_nothing_is_cut(browser, pictures, page, dark):
    """A4 without its margins is 703 units wide."""
    feature = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    try:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": feature})
        show(browser, page)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": feature})
        metrics = {"width": 703, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
        wide = (
            "return [...document.querySelectorAll('.main-svg, table, pre')].map((one) => one.getBoundingClientRect())"
        )
        assert in_time(lambda: all(0 <= one["left"] and one["right"] <= 703 for one in browser.execute_script(wide)))
        assert browser.execute_script("return document.documentElement.scrollWidth") <= 703
        screenshot(browser, pictures / f"tracking-paper-{'dark' if dark else 'light'}.png")
        white = "return document.getElementById('scene-plot')._fullLayout.paper_bgcolor"
        assert browser.execute_script(white) == "#fff"
        browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
        assert in_time(lambda: (browser.execute_script(white) == "#fff") is not dark)
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
