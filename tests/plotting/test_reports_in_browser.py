"""Reports in a real browser: they draw, keep to themselves what they hold, and fit phones and paper."""

import io
import re

import numpy as np
import pytest

import assoc
from assoc.association.solving import ScanOptions, associate_scans, gathered
from assoc.plotting.report import (
    write_association_report,
    write_registration_report,
    write_sweep_report,
    write_tracking_report,
)
from assoc.registration import register
from assoc.simulation import simulate
from assoc.sweeps import Study, grid
from assoc.sweeps.sources import StudySource
from tests.browser import DESKTOP, PHONE, complaints, in_time, requests, screenshot, show
from tests.registration.common import biased_scene

KINDS = ["scene", "problem", "tracks", "study", "biases"]
BUTTONS = {"Download plot as a PNG", "Zoom", "Pan", "Zoom in", "Zoom out", "Reset axes"}
CLICK_ALL = """
const buttons = [...document.querySelectorAll('.modebar-btn')];
document.querySelectorAll('a, .updatemenu-button, .legendtoggle').forEach(
  (one) => one.dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true})));
buttons.forEach((one) => one.dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true})));
return buttons.map((one) => one.dataset.title);
"""
READY = "return document.documentElement.dataset.ready === 'yes'"
LOCAL = ("file:", "data:", "blob:", "about:")


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """One report of each kind."""
    folder = tmp_path_factory.mktemp("reports")
    scene = simulate("three-radar", 0, scans=4)
    association = assoc.associate(scene, "aco")
    write_association_report(folder / "scene.html", association, scene, words=["scene.npz"])
    problem = assoc.AssignmentProblem.from_dense(np.random.default_rng(0).normal(size=(4, 4, 4)), dummy=False)
    options = ScanOptions("exact")
    write_association_report(folder / "problem.html", gathered(associate_scans((problem,), options), options), problem)
    rows = association.to_frame().rename(columns={"target": "track_id"})
    write_tracking_report(folder / "tracks.html", rows[["track_id", "time", "x", "y", "z"]].dropna(), scene)
    settings = grid("aco", {"alpha": [1, 2], "rho": [0.3, 0.9]})
    Study([StudySource(scene, "scene")], settings, 2).run(folder / "study")
    write_sweep_report(folder / "study.html", folder / "study")
    write_registration_report(folder / "biases.html", register(biased_scene(scans=8)))
    return folder


@pytest.mark.parametrize("name", KINDS)
def test_the_page_names_no_server(pages, name):
    page = (pages / f"{name}.html").read_text()
    assert ("Plotly.newPlot" in page) == (name != "study")
    servers = {*re.findall(r"\b(?:https?|wss?)://([\w.{}-]+)", re.sub(r"/\*!.*?\*/", "", page, flags=re.DOTALL))}
    assert servers == ({"www.w3.org"} if name != "study" else set())  # names of vocabularies, which nothing asks for


@pytest.mark.slow
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("name", KINDS)
def test_it_draws_and_nothing_leaves(browser, pages, pictures, tmp_path, name, size):
    from PIL import Image

    browser.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(tmp_path)})
    requests(browser)  # what an earlier page asked for
    show(browser, pages / f"{name}.html", size)
    assert in_time(lambda: browser.execute_script(READY))
    # nothing but the boxes of tables scrolls sideways
    assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    drawn = browser.execute_script("return document.querySelectorAll('.js-plotly-plot .main-svg').length")
    plots = browser.execute_script("return document.querySelectorAll('.plot').length")
    assert drawn >= 2 * plots and (plots > 0) == (name != "study")
    assert browser.execute_script("return [...document.images].every((one) => one.naturalWidth > 0)")
    picture = Image.open(io.BytesIO(screenshot(browser, pictures / f"{name}-{size[0]}.png"))).convert("RGB")
    # a page that was not drawn has few colours
    assert len(np.unique(np.asarray(picture).reshape(-1, 3)[::7], axis=0)) > 50
    windows = browser.window_handles
    assert {*browser.execute_script(CLICK_ALL)} == (BUTTONS if plots else set())
    assert not plots or in_time(lambda: [*tmp_path.glob("*.png")])
    assert browser.window_handles == windows
    assert [one for one in requests(browser) if not one.startswith(LOCAL)] == []
    # "Pause" ends an animation, whose promise plotly then breaks
    known = ("willReadFrequently", "Uncaught (in promise)")
    assert [one for one in complaints(browser) if not any(words in one for words in known)] == []


@pytest.mark.slow
def test_the_slider_shows_another_scan(browser, pages):
    show(browser, pages / "scene.html")
    found = "return document.getElementById('scene-0').data.find((one) => one.name === 'targets found').x"
    label = "return document.querySelector('#scene-0 .slider-label').textContent"
    first = browser.execute_script(found)
    assert "scan 0" in browser.execute_script(label)
    # plotly knows the frames in the next moment
    assert in_time(
        lambda: browser.execute_script("return document.getElementById('scene-0')._transitionData._frames.length")
    )
    browser.execute_script("Plotly.animate('scene-0', ['3'], {mode: 'immediate', frame: {duration: 0}})")
    assert in_time(lambda: "scan 3" in browser.execute_script(label))
    assert browser.execute_script(found) != first


@pytest.mark.slow
def test_a_script_that_slips_through_does_not_run(browser, pages, tmp_path):
    """The policy of the page is the second wall; see that it stands."""
    broken = tmp_path / "broken.html"
    text = (pages / "scene.html").read_text()
    broken.write_text(text.replace("<main>", "<main><script>window.slipped = 1</script>", 1))
    show(browser, broken)
    assert browser.execute_script("return window.slipped === undefined")
    assert any("Content Security Policy" in one for one in complaints(browser))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["scene", "tracks"])
def test_on_paper_nothing_is_cut(browser, pictures, pages, name):
    """A4 without its margins is 703 units wide."""
    show(browser, pages / f"{name}.html")
    assert in_time(lambda: browser.execute_script(READY))  # only then does the page hear of paper
    try:
        browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
        wide = "return [...document.querySelectorAll('.main-svg')].map((one) => one.getBoundingClientRect().width)"
        assert in_time(lambda: max(browser.execute_script(wide)) <= 703)
        screenshot(browser, pictures / f"{name}-paper.png")
        browser.execute_script("window.dispatchEvent(new Event('afterprint'))")
        assert in_time(lambda: max(browser.execute_script(wide)) > 703)
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
