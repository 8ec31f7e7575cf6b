"""The report of a registration, and its picture: what they show is what was found."""

from importlib.resources import files

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.plotting import plot_residuals
from assoc.plotting.report import write_registration_report
from assoc.registration import register
from experiments.common.browser import DESKTOP, PHONE, complaints, press, screenshot, show
from tests.plotting.test_association_report import EVIL, data_of, parsed
from tests.registration.common import biased_scene, radars, scene_of


@pytest.fixture(scope="module")
def found():
    return register(biased_scene(scans=8))


@pytest.fixture(scope="module")
def page(found, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "registration.html"
    write_registration_report(path, found, name=EVIL, words=["x.npz", EVIL])
    return path


def test_figures(page, found):
    data = data_of(page)["residuals"]
    assert [one["component"] for one in data] == ["range", "azimuth", "elevation"]
    for i, one in enumerate(data):
        scale = 1.0 if i == 0 else 180.0 / np.pi
        for s, sensor in enumerate(one["sensors"]):
            np.testing.assert_allclose(sensor["before"], scale * found.residuals[s].before[:, i], atol=1e-5)
            np.testing.assert_allclose(sensor["after"], scale * found.residuals[s].after[:, i], atol=1e-5)
            assert sensor["limit"] == pytest.approx(1.96 * scale * np.sqrt(found.sensors[s].covariance[i, i]))
    text = " ".join(parsed(page).text)
    assert "9 of 9" in text and "radar 1" in text and "python -m assoc.register" in text and text.count(EVIL) >= 2


def test_what_cannot_be_observed_is_named(tmp_path):
    place = np.array([-60e3, 0.0, 0.0])
    result = register(scene_of(radars(places=[place, place]), 1, 5))
    write_registration_report(tmp_path / "one.html", result)
    text = " ".join(parsed(tmp_path / "one.html").text)
    assert all(line in text for line in result.open) and "0 of 6" in text
    write_registration_report(tmp_path / "alone.html", register(scene_of(radars(1), 1, 2)))
    assert data_of(tmp_path / "alone.html")["residuals"][0]["sensors"][0]["before"] == []


def test_tables_are_made_to_sort_once():
    """Where two listen to the same heading, the second undoes what the first has done."""
    scripts = {one.name: one.read_text() for one in (files("assoc.plotting.report") / "static").iterdir()}
    assert [name for name, text in scripts.items() if "makeSortable" in text] == ["core.js"]


def test_picture(found):
    ax = plot_residuals(found, "azimuth")
    assert ax.get_ylabel() == "residual of azimuth (deg)"
    assert [label.get_text() for label in ax.get_xticklabels()] == ["radar 1", "radar 2", "radar 3"]
    with pytest.raises(InvalidInputError, match="no sensor measures 'x'"):
        plot_residuals(found, "x")


@pytest.mark.slow
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_it_works_in_a_browser(browser, page, pictures, size):
    show(browser, page, size)
    assert browser.execute_script("return document.documentElement.dataset.ready") == "yes"
    assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    names = browser.execute_script("return document.getElementById('residuals-range').data.map((t) => t.name)")
    assert names == ["before", "after"]
    press(browser, browser.find_elements("css selector", "#bias-table th button")[3])
    sorted_by = "return document.querySelectorAll('#bias-table th')[3].getAttribute('aria-sort')"
    assert browser.execute_script(sorted_by) == "ascending"
    screenshot(browser, pictures / f"registration-{size[0]}.png")
    assert complaints(browser) == []
