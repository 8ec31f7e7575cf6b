"""The report of a registration, and its picture: what they show is what was found."""

import numpy as np
import pytest

from assoc.plotting.report import write_registration_report
from assoc.registration import register
from tests.plotting.pages import EVIL, figures_of, named, text_of
from tests.registration.common import biased_scene, radars, scene_of


@pytest.fixture(scope="module")
def found():
    return register(biased_scene(scans=8))


@pytest.fixture(scope="module")
def page(found, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "registration.html"
    write_registration_report(path, found, name=EVIL, words=["x.npz", EVIL])
    return path


@pytest.mark.slow
def test_figures(page, found):
    figures = figures_of(page)
    assert [*figures] == [f"residuals-before-and-after-{i}" for i in range(3)]
    for i, figure in enumerate(figures.values()):
        scale = 1.0 if i == 0 else 180.0 / np.pi
        for when in ("before", "after"):
            box = named(figure["data"], when)
            for s, residuals in enumerate(found.residuals):
                values = np.sort(scale * getattr(residuals, when)[:, i])
                assert box["median"][s] == pytest.approx(np.median(values))
                assert np.mean(values <= box["q3"][s]) == pytest.approx(0.75, abs=0.02)
                assert np.mean(values < box["lowerfence"][s]) == pytest.approx(0.025, abs=0.02)
        limits = [1.96 * scale * np.sqrt(sensor.covariance[i, i]) for sensor in found.sensors]
        assert figure["data"][2]["y"] == pytest.approx(limits)
    text = text_of(page)
    assert "9 of 9" in text and "radar 1" in text and "python -m assoc.register" in text and text.count(EVIL) >= 2


def test_what_cannot_be_observed_is_named(tmp_path):
    place = np.array([-60e3, 0.0, 0.0])
    result = register(scene_of(radars(places=[place, place]), 1, 5))
    write_registration_report(tmp_path / "one.html", result)
    text = text_of(tmp_path / "one.html")
    assert all(line in text for line in result.open) and "0 of 6" in text
    write_registration_report(tmp_path / "alone.html", register(scene_of(radars(1), 1, 2)))
    first = figures_of(tmp_path / "alone.html")["residuals-before-and-after-0"]
    assert named(first["data"], "before")["median"] == [None]
