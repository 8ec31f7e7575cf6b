"""The report of an association in a real browser: it draws, the slider moves, tables and pictures follow."""

import io

import numpy as np
import pytest

import assoc
from assoc.association.plan import Plan
from assoc.plotting.report import write_association_report
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.simulation import simulate
from experiments.common.browser import DESKTOP, PHONE, complaints, in_time, press, screenshot, show
from tests.plotting.test_association_report import EVIL

CURRENT = "return document.querySelector('#scan-table tr[aria-current=true]').dataset.row"
LINK = '<a href="javascript:alert(2)">b</a>'
MOVE = (
    "const s = document.getElementById(arguments[0]); s.value = arguments[1];s.dispatchEvent(new Event(arguments[2]))"
)
INSIDE = """
const plot = document.getElementById('ants-plot'), drawn = plot.querySelector('.main-svg');
return drawn.getBoundingClientRect().bottom <= plot.getBoundingClientRect().bottom + 1;
"""
READY = "return document.documentElement.dataset.ready"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The report of 100 scans."""
    scene = simulate("three-radar", 0)
    path = tmp_path_factory.mktemp("report") / "out.html"
    write_association_report(path, assoc.associate(scene, "aco"), scene, ["scene.npz"] * 100, words=["scene.npz"])
    return path


def shades(picture):
    """Return how many colours a picture has: a page that was not drawn has few."""
    from PIL import Image

    return len(np.unique(np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).reshape(-1, 3)[::7], axis=0))


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_it_draws_without_a_complaint(browser, page, pictures, size):
    show(browser, page, size)
    assert browser.execute_script(READY) == "yes"
    assert not browser.find_element("id", "failure").is_displayed()
    # nothing but the boxes of tables scrolls sideways
    assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    shot = screenshot(browser, pictures / f"association-{size[0]}.png")
    assert shades(shot) > 50
    names = browser.execute_script("return document.getElementById('scene-plot').data.map((one) => one.name)")
    assert {"truth", "radar 1", "radar 2", "radar 3", "association", "false alarms", "targets found"} <= {*names}
    assert complaints(browser) == []


@pytest.mark.slow
def test_slider_table_and_pictures_follow_one_another(browser, page):
    show(browser, page)
    found = "const p = document.getElementById('scene-plot'); return p.data.find((t) => t.name === 'targets found').x"
    first = browser.execute_script(found)
    browser.execute_script(
        "const s = document.getElementById('slider'); s.value = '42'; s.dispatchEvent(new Event('input'))"
    )
    assert browser.execute_script(CURRENT) == "42"
    assert "scan 42" in browser.find_element("id", "slider-label").text
    assert browser.execute_script(found) != first
    # a row chooses its scan, also after sorting by another column
    press(browser, browser.find_elements("css selector", "#scan-table thead button")[2])
    counts = browser.execute_script(
        "return [...document.querySelectorAll('#scan-table tbody tr')].map((r) => Number(r.cells[2].dataset.key))"
    )
    assert counts == sorted(counts) and counts[0] < counts[-1]
    row = browser.find_elements("css selector", "#scan-table tbody tr")[3]
    number = row.get_attribute("data-row")
    press(browser, row.find_element("css selector", "a"))
    assert browser.execute_script(CURRENT) == number
    assert browser.execute_script("return document.getElementById('slider').value") == number
    press(browser, browser.find_element("id", "after"))
    assert browser.execute_script("return document.getElementById('slider').value") == str(min(int(number) + 1, 99))
    assert complaints(browser) == []


@pytest.mark.slow
def test_a_target_shows_its_tuple_cost_and_residuals(browser, page, pictures):
    show(browser, page, fragment="#scan-7")
    assert browser.execute_script("return document.getElementById('slider').value") == "7"
    target = browser.find_elements("css selector", "#targets tbody tr")[1]
    cells = [cell.text for cell in target.find_elements("css selector", "td")]
    press(browser, target)
    detail = browser.find_element("id", "detail").text
    assert f"tuple {cells[1]}" in detail and "cost" in detail and "azimuth" in detail and "σ" in detail
    press(browser, browser.find_element("id", "nearer"))
    width = "const r = document.getElementById('scene-plot').layout.xaxis.range; return r[1] - r[0]"
    assert browser.execute_script(width) < 2.0  # kilometres
    screenshot(browser, pictures / "association-target.png")
    hover = "const p = document.getElementById('scene-plot'); return p.data.find((t) => t.name === 'radar 1').hovertext"
    assert any("cost" in text and "range" in text for text in browser.execute_script(hover))
    assert complaints(browser) == []


@pytest.mark.slow
def test_the_scene_in_space(browser, page, pictures):
    show(browser, page)
    press(browser, browser.find_element("id", "space"))
    kinds = browser.execute_script("return document.getElementById('scene-plot').data.map((one) => one.type)")
    assert {*kinds} == {"scatter3d"}
    screenshot(browser, pictures / "association-space.png")
    # plotly itself is told by Chromium how to read canvases faster
    assert [one for one in complaints(browser) if "willReadFrequently" not in one] == []


@pytest.mark.slow
def test_names_from_files_show_as_text(browser, tmp_path):
    view = [[0, 1e4], [-3, 3], [0, 1]]
    sensors = [
        Radar3D(position=(0, 0, 0), noise=(10, 1e-3, 1e-3), field_of_view=view, name=EVIL),
        Radar3D(position=(500, 0, 0), noise=(10, 1e-3, 1e-3), field_of_view=view, name=LINK),
    ]
    place = np.array([[1e3, 2e3, 300.0]])
    scene = Scene(sensors, [0.0], [[one.measure(place) for one in sensors]], name="<img src=x onerror=alert(3)>")
    path = tmp_path / "out.html"
    write_association_report(path, assoc.associate(scene), scene, [EVIL], words=[EVIL])
    show(browser, path)
    assert browser.find_element("tag name", "h1").text == "<img src=x onerror=alert(3)>"
    press(browser, browser.find_element("css selector", "#targets tbody tr"))
    assert EVIL in browser.find_element("id", "detail").text
    legend = browser.find_elements("css selector", "#scene-plot .legendtext")
    assert {EVIL, LINK} <= {one.get_attribute("textContent") for one in legend}
    assert not browser.find_elements("css selector", "#scene-plot a[href*=javascript], main img")
    assert complaints(browser) == []


@pytest.mark.slow
def test_a_script_that_slips_through_does_not_run(browser, page, tmp_path):
    """The policy of the page is the second wall; see that it stands."""
    broken = tmp_path / "broken.html"
    broken.write_text(page.read_text().replace("<main>", "<main><script>window.slipped = 1</script>", 1))
    show(browser, broken)
    assert browser.execute_script("return window.slipped === undefined")
    assert any("Content Security Policy" in one for one in complaints(browser))


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["paper", "mmas"])
def test_the_ants_over_their_cycles(browser, tmp_path, pictures, mode):
    """A slider over the cycles: the bars are the history's, and a scan that no ant walked says so."""
    scene = simulate("bearing-only", 0, targets=12, scans=3)
    parameters = {"mode": mode, "iterations": 20, "refinement": "none"}
    plan = Plan((scene,), "aco", parameters=parameters, pheromone=True)
    association = plan.gather(plan.run(plan.items()))
    history = association.scans[0].pheromone
    assert len(history.cycles) > 2
    path = tmp_path / "out.html"
    write_association_report(path, association, scene)
    bars = "return document.getElementById('ants-plot').data.map((t) => [t.y, t.x])"
    for size in (DESKTOP, PHONE):
        show(browser, path, size)
        assert in_time(lambda: browser.execute_script("return Boolean(document.getElementById('ants-plot').data)"))
        # the bars stay in their card
        assert in_time(lambda: browser.execute_script(INSIDE))
        for name, factor in (("pheromone", 1.0), ("probability", 100.0), ("visibility", 1.0)):
            browser.execute_script(MOVE, "ants-measure", name, "change")
            for cycle in (0, len(history.cycles) - 1):
                browser.execute_script(MOVE, "cycle-slider", str(cycle), "input")
                drawn = {y: x for trace in browser.execute_script(bars) for y, x in zip(*trace, strict=True)}
                names = [f"({', '.join(map(str, row))})" for row in history.tuples.tolist()]
                expected = factor * getattr(history, name)[cycle]
                assert [drawn[one] for one in names] == pytest.approx(expected.tolist(), rel=6e-3)
            screenshot(browser, pictures / f"ants-{mode}-{name}-{size[0]}.png")
        assert f"of {history.cycles[-1]}" in browser.find_element("id", "cycle-slider-label").text
        assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    assert complaints(browser) == []


@pytest.mark.slow
def test_dark_pages_phones_and_crowds(browser, tmp_path, pictures):
    scene = simulate("crowd", 0, targets=60)
    path = tmp_path / "crowd.html"
    write_association_report(path, assoc.associate(scene), scene)
    try:
        media = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", media)
        show(browser, path, PHONE)
        layout = "return document.getElementById('scene-plot').layout"
        assert browser.execute_script(f"{layout}.paper_bgcolor") == "#161b22"
        assert browser.execute_script("return getComputedStyle(document.body).backgroundColor") == "rgb(13, 17, 23)"
        # the picture stands above the summary, its legend is folded and opens
        top = "return document.getElementById(arguments[0]).getBoundingClientRect().top"
        assert browser.execute_script(top, "scene") < browser.execute_script(top, "summary")
        assert browser.execute_script(f"{layout}.showlegend") is False
        press(browser, browser.find_element("id", "legend"))
        assert browser.execute_script(f"{layout}.showlegend") is True
        screenshot(browser, pictures / "crowd-phone-dark.png")
        # the targets fill the view: no sensor outside of the crowd makes it wider
        show(browser, path, DESKTOP)
        low, high = browser.execute_script(f"{layout}.yaxis.range")
        reach = (scene.region[1, 1] - scene.region[1, 0]) / (1000.0 if scene.region.max() > 3000 else 1.0)
        assert high - low < 1.6 * reach
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
