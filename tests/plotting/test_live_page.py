"""The live page in a real browser: the picture moves, and nothing but this machine is asked."""

import http.client
import io
import itertools
import json
import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from assoc._cli.track.plot_lines import replayed
from assoc.errors import InvalidInputError
from assoc.plotting.live import LivePage
from assoc.scene import Scene
from assoc.sensors import PositionSensor, Radar2D
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, LiveTracker
from assoc.tracking.live.pictures import SensorState
from assoc.tracking.quality import TrackQuality
from tests.browser import DESKTOP, PHONE, complaints, in_time, screenshot


@pytest.fixture(scope="module")
def scene():
    return simulate("rotating-radars", 6, aircraft=8, duration=30.0, false_alarms=3.0)


@pytest.fixture(scope="module")
def film(scene):
    """Pictures of half a minute."""
    tracker = LiveTracker(
        scene, lambda: TRACKERS["nearest-neighbour"].for_scene(scene), turns=[4, 5, 5.5], quality=True
    )
    return [picture for plot in replayed(scene, 0.0) for picture in tracker.take(*plot)]


HEARD = [
    SensorState("radar 1", 29.5, 120, 0, False, (0,)),
    SensorState("radar 2", 14.0, 60, 3, True, (1,)),
    SensorState("radar 3", -np.inf, 0, 0, False, (2,)),
]


def with_doubts(picture):
    """The picture with a track that is coasting, and one that does not agree with its measurements."""
    first, *rest = picture.tracks
    worse = {rest[0].track_id: TrackQuality(3.25, False, (9, 4, 0))}
    return picture._replace(tracks=[replace(first, missed=1), *rest], agreements=picture.agreements | worse)


def wait_for(browser, script):
    assert in_time(lambda: browser.execute_script(script)), browser.execute_script("return state.textContent")


# boxes of the labels that were written: the texts beside a point, not that of the ruler
LABELS = """
const boxes = [], write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  if (x !== 18) boxes.push([x, y - 11, x + this.measureText(text).width, y + 2]);
  return write.call(this, text, x, y);
};
draw();
CanvasRenderingContext2D.prototype.fillText = write;
return boxes;
"""
POINTER = """
const [a, b] = place(arguments[0], arguments[1]), box = map.getBoundingClientRect();
for (const name of ["pointerdown", "pointerup"]) {
  map.dispatchEvent(new PointerEvent(name, {pointerId: 1, clientX: box.x + a + 3, clientY: box.y + b - 2}));
}
"""


@pytest.mark.slow
@pytest.mark.parametrize(("size", "dark"), [(DESKTOP, False), (PHONE, True)], ids=["desktop", "phone, dark"])
def test_the_picture_moves(browser, scene, film, pictures, size, dark):
    page = LivePage(scene, 0, "<b>Radars</b>")
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size[0] < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    feature = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": feature})
    try:
        browser.get_log("browser")
        browser.get(page.address)
        wait_for(browser, "return scene !== null")
        shots = []
        for part in (film[:12], film[12:]):
            for one in (*part[:-1], with_doubts(part[-1])):
                page.show(one, HEARD, {"late": 2, "lost": 7, "repeated": 0})
            wait_for(browser, f"return time === {part[-1].time} && !pending")
            name = f"live-{'dark' if dark else 'light'}-{size[0]}-{len(shots)}.png"
            shots.append(screenshot(browser, pictures / name))
        from PIL import Image

        first, second = (np.asarray(Image.open(io.BytesIO(one)).convert("RGB")).astype(int) for one in shots)
        assert first.shape == second.shape and (np.abs(first - second).sum(axis=2) > 60).sum() > 200
        assert f"{len(film[-1].tracks)} tracks" in browser.execute_script("return state.textContent")
        said = browser.execute_script("return state.textContent")
        assert said.endswith(", 2 late, 7 lost") and re.search(r" tracks \((\d+ coasting.*, )?1 inconsistent\)", said)
        chips = browser.execute_script(
            "return [...document.querySelectorAll('#sensors li')].map((one) => one.textContent)"
        )
        assert chips[1:] == ["radar 2: silent since 14 s, 60 plots, 3 refused", "radar 3: not heard yet, 0 plots"]
        assert chips[0].startswith("radar 1: ") and chips[0].endswith(" s ago, 120 plots")
        # a title is text, whatever it says
        assert browser.execute_script("return document.querySelector('h1').textContent") == "<b>Radars</b>"
        assert browser.execute_script("return document.querySelector('h1 b')") is None
        browser.execute_script("view = null; draw()")
        scale = browser.execute_script("return view.scale")
        browser.execute_script("map.dispatchEvent(new WheelEvent('wheel', {deltaY: -500, cancelable: true}))")
        assert browser.execute_script("return view.scale") > scale
        browser.execute_script("document.getElementById('fit').click()")
        wait_for(browser, f"return !pending && view && Math.abs(view.scale - {scale}) < 1e-9")
        boxes = browser.execute_script(LABELS)
        apart = [
            a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1] for a, b in itertools.combinations(boxes, 2)
        ]
        assert len(boxes) >= 5 and all(apart)
        # a click shows a track, n the next, Escape none
        id, x, y, *_ = browser.execute_script("return tracks[0]")
        browser.execute_script(POINTER, x, y)
        assert browser.execute_script("return chosen") == id
        screenshot(browser, pictures / f"live-{'dark' if dark else 'light'}-{size[0]}-track.png")
        share = browser.execute_script("return detail.offsetHeight / map.clientHeight")
        assert share < (0.3 if size == PHONE else 0.4)
        text = browser.execute_script("return detail.textContent")
        assert text.startswith(f"Track{id}") and "m/s" in text and "Since" in text
        assert "Statuscoasting" in text and "from radar 1" in text and "NIS" in text
        for key, expected in (("n", "tracks[1][0]"), ("p", "tracks[0][0]"), ("Escape", "null")):
            browser.execute_script(f"map.dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}'}}))")
            assert browser.execute_script(f"return chosen === {expected}")
            if key == "n":
                text = browser.execute_script("return detail.textContent")
                assert "from radar 19from radar 24from radar 30" in text and text.endswith("NIS3.25: inconsistent")
        for name in ("labels", "plots", "rings"):
            browser.execute_script(f"document.getElementById('{name}').click()")
            assert browser.execute_script(f"return show.{name}") is False
        assert browser.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")
        asked = browser.execute_script("return performance.getEntriesByType('resource').map((one) => one.name)")
        assert asked and all(one.startswith((page.address, "data:")) for one in asked)
        page.close()
        wait_for(browser, "return ended")
        assert browser.execute_script("return state.textContent").startswith("ended")
        assert complaints(browser) == []
    finally:
        page.close()
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def event_of(reader, name):
    """The data of the first event of a name that waits."""
    waiting = [reader.get_nowait() for _ in range(reader.qsize())]
    return json.loads(next(one for one in waiting if one.startswith(f"event: {name}\n")).split("data: ")[1])


def test_a_page_that_opens_later_has_trails(scene, film):
    page = LivePage(scene)
    for one in film:
        page.show(one._replace(names={film[-1].tracks[0].track_id: "4521"}))
    reader = page.join_reader()
    waiting = [reader.get_nowait() for _ in range(reader.qsize())]
    assert [one.split("\n")[0] for one in waiting] == ["event: scene", "event: trails", "event: picture"]
    _, trails, picture = (json.loads(one.split("data: ")[1]) for one in waiting)
    for track in film[-1].tracks:
        past = [one.position[:2] for shot in film for one in shot.tracks if one.track_id == track.track_id]
        np.testing.assert_allclose(trails[str(track.track_id)], np.round(past[-40:], 2), atol=0.01)
    assert len(trails) == len(film[-1].tracks) and max(map(len, trails.values())) > 10
    assert picture["names"] == {str(film[-1].tracks[0].track_id): "4521"}
    page.close()


def test_ais_stands_nowhere():
    """A sensor of positions has no mark and no rings, a radar has both."""
    box = np.array([[-1e4, 1e4]] * 2)
    ais = PositionSensor(position=np.zeros(3), noise=[9.0, 9.0], field_of_view=box, name="AIS")
    radar = Radar2D(position=[5, 6, 0], noise=[9, 1e-3], field_of_view=[[0, 2e4], [-3.14, 3.14]], name="shore")
    page = LivePage(Scene([radar, ais], [0.0], [[np.zeros((0, 2))] * 2]))
    assert event_of(page.join_reader(), "scene")["sensors"] == [["shore", 5.0, 6.0, 2e4], ["AIS", None, None, None]]
    page.close()


def test_a_browser_that_reads_no_more_does_not_hold_up_the_end(scene, film):
    page = LivePage(scene)
    reader = page.join_reader()
    for one in film * 3:
        page.show(one)
    assert reader.full()
    end = threading.Thread(target=page.close, daemon=True)
    end.start()
    end.join(200.0)
    assert not end.is_alive()
    last = [reader.get_nowait() for _ in range(reader.qsize())][-2:]
    assert last[0].startswith("event: end") and last[1] is None


def test_only_this_machine_is_served(scene):
    page = LivePage(scene)
    port = int(page.address.rsplit(":", 1)[1].strip("/"))
    try:
        for path, host, status in [
            ("/", "127.0.0.1", 200),
            ("/live.js", f"localhost:{port}", 200),
            ("/", "evil.example", 403),
            ("/events", "evil.example", 403),
            ("/../server.py", "127.0.0.1", 404),
            ("/server.py", "127.0.0.1", 404),
        ]:
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=300)
            connection.putrequest("GET", path, skip_host=True)
            connection.putheader("Host", host)
            connection.endheaders()
            answer = connection.getresponse()
            assert answer.status == status, (path, host)
            if status == 200:
                assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            connection.close()
        with pytest.raises(InvalidInputError, match=f"--page: port {port} cannot be used"):
            LivePage(scene, port)
    finally:
        page.close()
