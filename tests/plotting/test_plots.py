"""What the figures show, read back from the axes and compared with the arrays it should be."""

import itertools
import re

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from scipy import stats

import assoc
from assoc import plotting
from assoc.plotting.axes import set_log_x
from assoc.plotting.measured import distances_to_border, ellipses, positions_of
from assoc.plotting.study_figures import new_figure
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D
from assoc.simulation import simulate

mpl.use("agg")


@pytest.fixture
def ax():
    return new_figure().subplots()


@pytest.fixture(scope="module")
def scene():
    return simulate("three-radar", 2, scans=6)


@pytest.fixture(scope="module")
def association(scene):
    return assoc.associate(scene, "exact")


def line(ax, label):
    """Points (n, 2) of the line of that name."""
    found = [one for one in ax.lines if one.get_label() == label]
    assert len(found) == 1, [one.get_label() for one in ax.lines]
    return np.column_stack([np.asarray(found[0].get_xdata(), float), np.asarray(found[0].get_ydata(), float)])


def assert_units(ax):
    for text in (ax.get_xlabel(), ax.get_ylabel()):
        assert re.search(r"\((m|km|s|ms|nats|number|probability|.*measurement.*)\)$", text), text


def sensors():
    view = [[0, 9e4], [-np.pi, np.pi], [0, 1.5]]
    return [
        Radar3D(position=(100, -50, 10), noise=(20, 1e-3, 2e-3), field_of_view=view),
        Radar2D(position=(100, -50, 10), noise=(20, 1e-3), field_of_view=view[:2]),
        BearingSensor(position=(100, -50, 0), noise=1e-3),
        PositionSensor(position=(0, 0, 0), noise=(5, 6), field_of_view=[[-9e4, 9e4]] * 2),
        PositionSensor(position=(0, 0, 0), noise=(5, 6, 7), field_of_view=[[-9e4, 9e4]] * 3),
    ]


@pytest.mark.parametrize("span", [(2.45, 3.1), (95, 105), (2, 9), (2, 150), (0.02, 5e4)])
def test_numbers_at_a_logarithmic_axis_are_plain_and_apart(ax, span):
    ax.figure.set_size_inches(5, 3)
    ax.plot(span, [0, 1])
    set_log_x(ax)
    ax.figure.draw_without_rendering()
    shown = [
        one
        for one in ax.get_xticklabels(which="both")
        if one.get_text() and span[0] <= one.get_position()[0] <= span[1]
    ]
    assert len(shown) >= 3
    assert all(float(one.get_text().replace("\u2212", "-")) == pytest.approx(one.get_position()[0]) for one in shown)
    places = sorted((one.get_window_extent() for one in shown), key=lambda box: box.x0)
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(places)), [one.get_text() for one in shown]


def test_rays_end_on_the_border():
    region = np.array([[-1e3, 2e3], [-500.0, 700.0], [0.0, 10.0]])
    sensor = BearingSensor(position=(100, -50, 0), noise=1e-3)
    bearings = np.linspace(-np.pi, np.pi, 41)
    ends = positions_of(sensor, bearings[:, None], 0.0, distances_to_border(sensor, bearings, region))
    off = np.abs(ends[:, :2, None] - region[None, :2]).min(axis=(1, 2))
    inside = ((ends[:, :2] >= region[:2, 0] - 1e-6) & (ends[:, :2] <= region[:2, 1] + 1e-6)).all()
    assert inside and off.max() < 1e-6


def test_ellipses_hold_their_share():
    covariance = np.array([[[4.0, 1.5], [1.5, 2.0]], [[1.0, 0.0], [0.0, 9.0]]])
    centre = np.array([[1.0, 2.0], [-3.0, 0.0]])
    x, y = ellipses(centre, covariance, 0.9)
    for outline, c, p in zip(np.split(np.column_stack([x, y]), 2), centre, covariance, strict=True):
        assert np.isnan(outline[-1]).all()
        off = outline[:-1] - c
        square = np.einsum("ni,ij,nj->n", off, np.linalg.inv(p), off)
        assert square == pytest.approx(stats.chi2(2).ppf(0.9))


def test_scene(scene, ax):
    assert plotting.plot_scene(scene, ax=ax) is ax
    assert_units(ax)
    for s, sensor in enumerate(scene.sensors):
        assert len(line(ax, sensor.name)) == sum(len(scan[s]) for scan in scene.measurements)
    truth = line(ax, "truth")
    assert truth[~np.isnan(truth[:, 0])] == pytest.approx(
        np.concatenate([np.array([p[t, :2] for p in scene.truth.positions]) for t in range(3)]) / 1e3
    )
    # where all three targets and radars are is in view
    low, high = np.array(ax.get_xlim()), np.array(ax.get_ylim())
    assert (low[0] < truth[:, 0][~np.isnan(truth[:, 0])]).all() and high[1] > 56.7


def test_solution(scene, association, ax):
    one = next(scan for scan in association.scans if scan.false_alarms)
    assert plotting.plot_solution(scene, one, ax=ax) is ax
    assert_units(ax)
    assert np.isnan(line(ax, "association")[:, 0]).sum() == np.count_nonzero(one.targets)
    assert len(line(ax, "false alarms")) == one.false_alarms
    assert line(ax, "targets found") == pytest.approx(one.positions[:, :2] / 1e3)
    near = plotting.plot_solution(scene, one, target=0, ax=new_figure().subplots())
    assert np.diff(near.get_xlim())[0] < 1500 and near.get_xlabel() == "x (m)"
    with pytest.raises(assoc.InvalidInputError, match="target: expected 0 to"):
        plotting.plot_solution(scene, one, target=99, ax=ax)
    for wrong in (0.0, 1.0, -0.5, np.nan):
        with pytest.raises(assoc.InvalidInputError, match="probability: expected a number between 0 and 1"):
            plotting.plot_solution(scene, one, probability=wrong, ax=ax)
    other = assoc.simulation.simulate("crowd", 1, targets=2, scans=scene.num_scans)
    with pytest.raises(assoc.InvalidInputError, match="association: is not one of this scene"):
        plotting.plot_solution(other, one, ax=ax)


def test_tracks(scene, ax):
    rows = [
        {"track_id": 3 + t, "time": k, "x": p[t, 0], "y": p[t, 1]}
        for k, p in enumerate(scene.truth.positions)
        for t in range(3)
    ]
    frame = pd.DataFrame(rows).sample(frac=1.0, random_state=0)
    plotting.plot_tracks(frame, scene, ax=ax)
    assert_units(ax)
    assert line(ax, "track 4") == pytest.approx(np.array([p[1, :2] for p in scene.truth.positions]) / 1e3)
    for wrong in (np.nan, "here"):
        with pytest.raises(assoc.InvalidInputError, match="tracks: x, y must be"):
            plotting.plot_tracks(frame.assign(x=wrong), ax=ax)
    with pytest.raises(assoc.InvalidInputError, match="'time' is missing"):
        plotting.plot_tracks(frame.drop(columns="time"), ax=ax)
