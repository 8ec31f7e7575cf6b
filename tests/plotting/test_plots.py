"""What the figures show, read back from the axes and compared with the arrays it should be."""

import re
import sys

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from scipy import stats

import assoc
from assoc import plotting
from assoc.plotting.ellipses import ellipses, position_covariances
from assoc.plotting.heat_map import cells
from assoc.plotting.measured import distances_to_border, positions_of
from assoc.plotting.study_figures import new_figure
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D
from assoc.simulation import simulate
from assoc.solvers import pheromone

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


def test_a_place_measures_like_its_measurement():
    where = np.random.default_rng(0).uniform([-5e3, -5e3, 100], [5e3, 5e3, 4e3], (50, 3))
    for sensor in sensors():
        ground = np.hypot(*(where[:, :2] - sensor.position[:2]).T)
        assert positions_of(sensor, sensor.measure(where), where[:, 2], ground) == pytest.approx(where)


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


def test_covariances_of_places_are_those_of_the_jacobian():
    where = np.array([[3e3, 1e3, 500.0], [-2e3, 4e3, 900.0]])
    for sensor in (one for one in sensors() if one.dim == 3):
        inverse = np.linalg.inv(sensor.jacobian(where))
        expected = (inverse @ sensor.covariance @ np.swapaxes(inverse, 1, 2))[:, :2, :2]
        found = position_covariances(sensor, sensor.measure(where), where[:, 2])
        assert found == pytest.approx(expected, rel=1e-3, abs=1e-3)


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


def test_gates_are_drawn_for_every_kind_of_sensor(ax):
    scene = simulate("bearing-only", 0, targets=4, scans=1)
    plotting.plot_scene(scene, 0, gates=True, ax=ax)
    assert_units(ax)
    assert sum(one.get_linestyle() == "--" for one in ax.lines) == 2 * len(scene.sensors)
    radars = simulate("three-radar", 1, scans=1)
    other = plotting.plot_scene(radars, 0, gates=True, ax=new_figure().subplots())
    dashed = [one for one in other.lines if one.get_linestyle() == "--"]
    corners = sum(np.isnan(one.get_xdata()).sum() for one in dashed)
    assert corners == radars.scan(0).sizes.sum()


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
        with pytest.raises(assoc.InvalidInputError, match="gate_probability: expected a number between 0 and 1"):
            plotting.plot_scene(scene, 0, gates=True, gate_probability=wrong, ax=ax)
    with pytest.raises(assoc.InvalidInputError, match="bins: expected a whole number >= 1, got 0"):
        plotting.plot_gates(scene, association, bins=0, ax=ax)
    other = assoc.simulation.simulate("crowd", 1, targets=2, scans=scene.num_scans)
    for draw in (lambda: plotting.plot_solution(other, one, ax=ax), lambda: plotting.plot_gates(other, [one], ax=ax)):
        with pytest.raises(assoc.InvalidInputError, match="association: is not one of this scene"):
            draw()


def test_costs(scene, association, ax):
    problem, solution = assoc.build_problem(scene, 1), association.scans[1].solution
    plotting.plot_costs(problem, solution, ax=ax)
    assert_units(ax)
    every, chosen = line(ax, "candidate tuples"), line(ax, "chosen")
    assert every[:, 1] == pytest.approx(problem.costs) and chosen[:, 1].sum() == pytest.approx(solution.cost)
    assert (np.round(every[:, 0]) == np.count_nonzero(problem.tuples, axis=1)).all()
    with pytest.raises(assoc.InvalidInputError, match="not one of this problem"):
        plotting.plot_costs(problem, association.scans[2].solution, ax=ax)


def test_gates_fill_evenly_where_the_model_is_right():
    scene = simulate("three-radar", 5)
    ax = plotting.plot_gates(scene, assoc.associate(scene, "greedy"), bins=10, ax=new_figure().subplots())
    assert_units(ax)
    counts = np.array([bar.get_height() for bar in ax.patches])
    assert counts.sum() > 200 and stats.chisquare(counts).pvalue > 1e-4


def test_convergence(ax):
    problem = assoc.build_problem(simulate("bearing-only", 0, targets=12, scans=1), 0)
    found = {name: assoc.assign(problem, name) for name in ("lagrangian", "greedy")}
    plotting.plot_convergence(found, ax=ax)
    assert_units(ax)
    for name, solution in found.items():
        cost, bound = line(ax, f"{name}: cost"), line(ax, f"{name}: lower bound")
        assert cost[-1] == pytest.approx([solution.iterations, solution.cost])
        known = bound[~np.isnan(bound[:, 1]), 1]
        assert (np.diff(known) >= 0).all() and known[-1] <= solution.cost + 1e-9
    assert_units(plotting.plot_convergence(found["lagrangian"], over="time", ax=new_figure().subplots()))
    with pytest.raises(assoc.InvalidInputError, match="solutions: expected at least one, got none"):
        plotting.plot_convergence({}, ax=ax)


def test_pheromone_gathers_on_what_is_chosen(ax):
    problem = assoc.build_problem(simulate("crowd", 0, targets=6, scans=1), 0)
    history = pheromone(problem, seed=4, mode="paper", rho=0.8)
    solution = assoc.assign(problem, "aco", seed=4, mode="paper", rho=0.8)
    assert len(history.cycles) == solution.iterations
    chosen = {tuple(row) for row in history.tuples[history.chosen].tolist()}
    best = {tuple(row) for row in solution.tuples.tolist()}
    assert chosen <= best and len(chosen) >= 6
    # a measurement that is in no tuple with others is a false alarm before any ant walks
    shared = problem.tuples[np.count_nonzero(problem.tuples, axis=1) > 1]
    for row in best - chosen:
        sensor = int(np.argmax(row))
        assert np.count_nonzero(row) == 1 and not (shared[:, sensor] == row[sensor]).any()
    prices = dict(zip(map(tuple, problem.tuples.tolist()), problem.costs, strict=True))
    assert history.costs == pytest.approx([prices[tuple(row)] for row in history.tuples.tolist()])
    last = history.pheromone[-1]
    assert last[history.chosen].min() > last[~history.chosen].max()
    plotting.plot_pheromone(history, nodes=len(chosen), ax=ax)
    shown = {tuple(map(int, re.findall(r"\d+", text.get_text()))) for text in ax.get_yticklabels()}
    assert shown == chosen
    for of in ("visibility", "probability"):
        other = plotting.plot_pheromone(history, of=of, nodes=len(chosen), ax=new_figure().subplots())
        values = getattr(history.top(len(chosen)), of)
        if of == "visibility":
            values = values / np.nansum(history.visibility, axis=1, keepdims=True)
        (image,) = other.images
        assert np.asarray(image.get_array()) == pytest.approx(100.0 * values[:, ::-1].T)
        assert {"visibility": "visibility", "probability": "drawn"}[of] in image.colorbar.ax.get_ylabel()
    with pytest.raises(assoc.InvalidInputError, match="of: expected pheromone, visibility, probability, got 'colour'"):
        plotting.plot_pheromone(history, of="colour", ax=ax)


def test_heat_map_has_means_and_intervals(tmp_path, scene, ax):
    from assoc.sweeps import Study, grid, load
    from assoc.sweeps.sources import StudySource

    settings = grid("aco", {"mode": ["paper"], "alpha": [1, 2], "rho": [0.3, 0.6, 0.9]})
    Study([StudySource(scene, "scene")], settings, 2).run(tmp_path / "s")
    frame = load(tmp_path / "s")
    plotting.plot_heat_map(frame, "iterations", ("alpha", "rho"), ax=ax)
    texts = [text.get_text() for text in ax.texts]
    assert len(texts) == 6
    expected = frame.groupby(["rho", "alpha"])["iterations"].mean().to_numpy()
    for text, mean in zip(texts, expected, strict=True):
        middle, low, high = (float(one) for one in re.split(r"\n| \.\. ", text))
        assert middle == pytest.approx(mean, rel=5e-3) and low <= middle <= high
    # over a parameter that is not named all runs are averaged
    _, _, middle, low, high = cells(frame.assign(half=frame["rho"] > 0.5), "iterations", "alpha", "half")
    halves = frame.groupby([frame["rho"] > 0.5, "alpha"])["iterations"].mean().to_numpy().reshape(2, 2)
    assert middle == pytest.approx(halves) and (low <= middle).all() and (middle <= high).all()
    with pytest.raises(assoc.InvalidInputError, match="study: expected the runs of assoc.sweeps.load"):
        plotting.plot_heat_map(frame[["alpha", "rho"]], ax=ax)
    with pytest.raises(assoc.InvalidInputError, match="needs two that vary"):
        plotting.plot_heat_map(frame[frame["rho"] == 0.3], ax=ax)


def test_tracks_and_metric(scene, ax):
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
    other = plotting.plot_metric([0, 1, 2], {"a": [1, 2, 3], "b": [3, 2, np.nan]}, name="GOSPA", unit="m")
    assert_units(other)
    assert other.get_ylabel() == "GOSPA (m)" and line(other, "a")[:, 1].tolist() == [1, 2, 3]
    with pytest.raises(assoc.InvalidInputError, match="shape of times"):
        plotting.plot_metric([0, 1], [1.0], name="GOSPA", unit="m", ax=ax)


def test_overview_composes_the_others(scene, association):
    axes = plotting.plot_overview(scene, association, 2)
    assert [one.get_title() for one in axes][1] == "Association of scan 2" and len(axes) == 4
    with pytest.raises(assoc.InvalidInputError, match="no scan 77"):
        plotting.plot_overview(scene, association, 77)
    mpl.pyplot.close("all")


def test_series_differ_without_colour():
    from assoc.plotting.colours import DASHES, MARKERS, SERIES

    assert len({*MARKERS}) == len({*map(str, DASHES)}) == len({*SERIES}) == 7


def test_every_name_is_there_and_matplotlib_is_asked_for(scene, monkeypatch):
    assert all(callable(getattr(plotting, name)) for name in plotting.__all__)
    with pytest.raises(AttributeError, match="no attribute 'plot_nothing'"):
        plotting.plot_nothing  # noqa: B018
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"python -m pip install 'assoc\[plot\]'"):
        plotting.plot_scene(scene)


def test_gates_of_measurements_with_times_of_their_own_are_refused(ax):
    scene = simulate("rotating-radars", 0, aircraft=5, duration=8.0, interval=4.0)
    with pytest.raises(assoc.InvalidInputError, match="scan 0 has measurements with times of their own"):
        plotting.plot_gates(scene, assoc.associate(scene), ax=ax)
