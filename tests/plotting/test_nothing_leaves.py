"""Reports keep the data: whatever is clicked, no window opens and nothing is asked for from a network."""

import base64
import gzip
import re
import time

import numpy as np
import pytest

import assoc
from assoc.association.plan import Plan
from assoc.plotting.report import write_association_report, write_sweep_report, write_tracking_report
from assoc.simulation import simulate
from assoc.sweeps import Study, grid
from assoc.sweeps.sources import StudySource
from experiments.common.browser import DESKTOP, PHONE, complaints, in_time, press, requests, show

BUTTONS = {"Download plot as a PNG", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"}
SPACE_BUTTONS = {"Orbital rotation", "Turntable rotation", "Reset camera to default"}
CLICK_ALL = """
const shown = (one) => one.getClientRects().length > 0 && !one.disabled;
const click = (one) => {
  if (shown(one)) one.dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true}));
};
// a click may replace what comes later: that is not shown then
document.querySelectorAll('button, a, tbody tr').forEach(click);
for (const box of [...document.querySelectorAll('select, input')].filter(shown)) {
  if (box.options) box.selectedIndex = box.options.length - 1; else box.value = box.max;
  box.dispatchEvent(new Event(box.options ? 'change' : 'input'));
}
const buttons = [...document.querySelectorAll('.modebar-btn')].filter(shown);
const known = new Set(document.querySelectorAll('button'));
buttons.forEach(click);
// what asks before it sends is told yes: the last button of a dialog
[...document.querySelectorAll('button')].filter((one) => !known.has(one)).reverse().forEach(click);
return buttons.map((one) => one.dataset.title);
"""
CHARTS = ".traces:first-child .legendtoggle, .js-plotly-plot"
LOCAL = ("file:", "data:", "blob:", "about:")


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """One report of each kind."""
    folder = tmp_path_factory.mktemp("reports")
    scene = simulate("three-radar", 0, scans=2)
    association = assoc.associate(scene, "aco")
    write_association_report(folder / "scene.html", association, scene)
    problem = assoc.AssignmentProblem.from_dense(np.random.default_rng(0).normal(size=(4, 4, 4)), dummy=False)
    plan = Plan((problem,), "exact")
    write_association_report(folder / "problem.html", plan.gather(plan.run(plan.items())), problem)
    rows = association.to_frame().rename(columns={"target": "track_id"})
    write_tracking_report(folder / "tracks.html", rows[["track_id", "time", "x", "y", "z"]].dropna(), scene)
    settings = grid("aco", {"alpha": [1, 2], "rho": [0.3, 0.9]})
    Study([StudySource(scene, "scene")], settings, 2).run(folder / "study")
    write_sweep_report(folder / "study.html", folder / "study")
    return folder


@pytest.mark.parametrize("name", ["scene", "problem", "tracks", "study"])
def test_the_page_names_no_server(pages, name):
    page = (pages / f"{name}.html").read_text()
    packed = re.search(r'id="packed">([^<]+)<', page)
    script = gzip.decompress(base64.b64decode(packed[1])).decode()
    assert "Plotly" in script and packed[0] in page
    text = re.sub(r"/\*!.*?\*/", "", page.replace(packed[1], "") + script, flags=re.DOTALL)
    servers = {*re.findall(r"\b(?:https?|wss?)://([\w.{}-]+)", text)}
    assert servers == {"www.w3.org"}  # names of vocabularies, which nothing asks for


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "size"),
    [("scene", DESKTOP), ("problem", DESKTOP), ("tracks", DESKTOP), ("study", DESKTOP), ("scene", PHONE)],
    ids=["scene", "problem", "tracks", "study", "scene on a phone"],
)
def test_no_click_opens_or_asks_for_anything(browser, pages, tmp_path, name, size):
    browser.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    requests(browser)  # what an earlier page asked for
    show(browser, pages / f"{name}.html", size)
    windows, address = browser.window_handles, browser.current_url.partition("#")[0]
    charts = click_all(browser)
    if name == "scene":
        press(browser, browser.find_element("id", "space"))
        charts |= click_all(browser)
    if size == DESKTOP:
        assert charts == (BUTTONS | SPACE_BUTTONS if name == "scene" else BUTTONS)
        # the picture of a chart is made here and kept here
        assert in_time(lambda: [*tmp_path.glob("*.png")])
    else:
        assert charts == set()
    assert browser.window_handles == windows
    assert browser.current_url.partition("#")[0] == address
    assert [one for one in requests(browser) if not one.startswith(LOCAL)] == []
    assert [one for one in complaints(browser) if "willReadFrequently" not in one and "GPU stall" not in one] == []


def click_all(browser):
    """Click every button, link, row, choice, legend and chart; return what the buttons of the charts are called."""
    names = {*browser.execute_script(CLICK_ALL)}
    for number in range(len(browser.find_elements("css selector", CHARTS))):
        assert in_time(lambda number=number: click_chart(browser, number))
    return names


def click_chart(browser, number):
    """Click one of the charts and legends; whether it was there: a chart drawn anew has other elements than before."""
    from selenium.common.exceptions import StaleElementReferenceException
    from selenium.webdriver import ActionChains

    try:
        one = browser.find_elements("css selector", CHARTS)[number]
        browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", one)
        ActionChains(browser).move_to_element(one).click().perform()
    except (IndexError, StaleElementReferenceException):
        return False
    return True


CLICKED_WHILE_IT_DRAWS = """
const plot = document.getElementById('scene-plot');
const click = () => plot.emit('plotly_click', {points: [{customdata: 1}]});
const react = Plotly.react;
window.drawn = 0;
Plotly.react = (...all) => { if (all[0] === plot) { window.drawn += 1; click(); } return react(...all); };
click();
"""


@pytest.mark.slow
def test_a_target_clicked_in_space_is_drawn_once(browser, pages):
    """Charts in space say that they were clicked in the middle of each drawing, while the button is down."""
    show(browser, pages / "scene.html", PHONE)
    press(browser, browser.find_element("id", "space"))
    browser.execute_script(CLICKED_WHILE_IT_DRAWS)
    assert in_time(lambda: "Target 2" in browser.find_element("id", "detail").text)
    time.sleep(0.2)
    assert browser.execute_script("return window.drawn") == 1
    assert not [one for one in complaints(browser) if "RangeError" in one]


@pytest.mark.slow
def test_no_script_opens_a_window(browser, pages):
    """What plotly offers where there is no WebGL: a click that opens its help page."""
    show(browser, pages / "scene.html")
    windows = browser.window_handles
    assert browser.execute_script("return window.open('about:blank') === null")
    assert browser.window_handles == windows
