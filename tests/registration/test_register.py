"""Registration against biases that were put in, against scipy's least squares, and where nothing can be known."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from assoc import Scene
from assoc.costs.arrays import sensor_arrays
from assoc.costs.gating import chi_square_quantiles
from assoc.errors import InvalidInputError
from assoc.recordings.several import NO_HEIGHT
from assoc.registration import RegistrationParameters, Term, register, with_biases
from assoc.registration.correction import corrected_measurements
from assoc.registration.epochs import scene_epochs
from assoc.registration.estimation import estimate
from assoc.registration.normal_equations import NormalEquations, normal_equations
from assoc.registration.pairing import tuple_arrays
from assoc.registration.register import make_problem
from assoc.registration.result import describe
from assoc.registration.terms import term_arrays
from assoc.sensors import BearingSensor, Platform, PositionSensor, Radar2D, Radar3D
from assoc.simulation import simulate
from assoc.simulation.radars import on_circle
from assoc.simulation.turning import Path, observe_in_turns
from tests.registration.common import BIASES, REGION, biased_scene, late_scene, paths, radars, scene_of


def truth_of(found, biases):
    return np.array([biases[term.sensor].get(term.component, 0.0) for term in found.terms])


@pytest.fixture(scope="module")
def found():
    return register(biased_scene())


def test_large_biases_are_found_within_what_it_says(found):
    off = found.biases - truth_of(found, BIASES)
    assert (np.abs(off) < 4.5 * found.deviations).all()
    in_range = [term.component == "range" for term in found.terms]
    assert np.abs(off[in_range]).max() < 25.0 and np.degrees(np.abs(off[np.logical_not(in_range)]).max()) < 0.03
    assert found.observed.all() and found.open == () and found.significant
    assert 0.9 < found.noise < 1.1


@pytest.mark.slow
def test_errors_agree_with_the_covariance():
    """Normalised squared errors over seeds: their mean is 1, and 99 % of such means lie in this interval."""
    squares, n = [], 0
    for seed in range(8):
        result = register(biased_scene(seed, 8))
        off = result.biases - truth_of(result, BIASES)
        squares.append(off @ np.linalg.solve(result.covariance, off))
        n = len(off)
    from scipy.stats import chi2

    assert chi2.ppf(0.005, 8 * n) < sum(squares) < chi2.ppf(0.995, 8 * n)


def test_deviations_count_what_is_weighted_down():
    """The slope of the sums is that of differences between biases nearby, and flatter than the information."""
    sensors = [
        Radar2D(
            position=sensor.position, noise=[50.0, 1e-3], detection_probability=0.9, false_alarm_rate=5.0,
            field_of_view=[[0, 2e5], [-np.pi, np.pi]], name=sensor.name,
        )
        for sensor in radars(2)
    ]  # fmt: skip
    scene = with_biases(scene_of(sensors, 5), [{"range": 300.0, "azimuth": -5e-3}, {"range": -250.0}])
    problem = make_problem(scene, RegistrationParameters())
    epochs = scene_epochs(scene, moving=False)
    found = estimate(problem, epochs)
    corrected = problem.scene(epochs, found.biases)
    tuples = tuple_arrays(corrected, epochs, found.chosen, np.zeros(2))
    terms, limits = term_arrays(problem.terms, problem.sensors), chi_square_quantiles(0.95, 6)

    def sums_at(shift):
        """Those of measurements with other biases, around the same positions."""
        z = tuples.z - np.pad(shift.reshape(2, 2), ((0, 0), (0, 1)))
        parts = normal_equations(sensor_arrays(corrected), tuples._replace(z=z), terms, limits)
        return NormalEquations(*parts)

    sums, steps = sums_at(np.zeros(4)), np.diag([0.01, 1e-7, 0.01, 1e-7])
    falls = [(sums_at(-step).gradient - sums_at(step).gradient) / (2.0 * step.max()) for step in steps]
    scale = 1.0 / np.sqrt(np.diagonal(sums.information))
    np.testing.assert_allclose(
        scale * np.transpose(falls) * scale[:, None], scale * sums.slope * scale[:, None], atol=1e-4
    )
    assert (np.diagonal(sums.slope) < 0.97 * np.diagonal(sums.information)).all()
    prior = np.diag(problem.spreads**-2.0)
    inverse = np.linalg.inv(sums.slope + prior)
    expected = np.sqrt(np.diagonal(inverse @ (sums.scatter + prior) @ inverse))
    # by the information they are 9 to 18 % too small; a tuple that comes to its limit in the last step changes 4 %
    np.testing.assert_allclose(np.sqrt(np.diagonal(found.covariance)), expected, rtol=0.07)


@pytest.mark.slow
def test_estimate_is_the_least_squares_solution():
    """All positions and biases at once by scipy, true tuples, no false alarms, against positions eliminated."""
    scene = with_biases(scene_of(radars(false_alarms=1e-9), 3, 3, aircraft=6), BIASES)
    ours = register(scene)
    tuples = [(k, row) for k in range(3) for row in scene.scan(k).true_tuples()]
    assert ours.tuples == len(tuples)
    starts = [scene.scan(k).truth_positions for k in range(3)]
    x0 = np.concatenate([np.zeros(9)] + [starts[k][_target(scene, k, row)] for k, row in tuples])
    scale = np.array([sensor_scale(s, c) for s in range(3) for c in range(3)])

    def cost(x):
        biases, rest = x[:9].reshape(3, 3), x[9:].reshape(-1, 3)
        parts = [x[:9] / scale]
        for (k, row), place in zip(tuples, rest, strict=True):
            for s in np.flatnonzero(row):
                sensor = scene.sensors[s]
                z = scene.measurements[k][s][row[s] - 1] - biases[s]
                parts.append(
                    sensor.residual(z[None], sensor.measure(place[None]))[0] / np.sqrt(np.diag(sensor.covariance))
                )
        return np.concatenate(parts)

    sizes = np.concatenate([np.tile([100.0, 1e-3, 1e-3], 3), np.full(len(x0) - 9, 100.0)])
    best = least_squares(cost, x0, x_scale=sizes, xtol=1e-12, ftol=1e-12)
    # beyond the 95 % of tuples that count fully we count less: a fraction of a standard deviation
    assert (np.abs(ours.biases - best.x[:9]) < 0.35 * ours.deviations).all()
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:9, :9]
    np.testing.assert_allclose(ours.deviations, np.sqrt(np.diag(covariance)), rtol=0.5)


def sensor_scale(s, c):
    return (300.0, np.radians(0.3), np.radians(0.3))[c]


def _target(scene, k, row):
    s = int(np.flatnonzero(row)[0])
    return int(scene.truth.sources[k][s][row[s] - 1])


def test_two_radars_at_one_place():
    place = np.array([-60e3, 0.0, 0.0])
    result = register(scene_of(radars(places=[place, place]), 1, 10))
    assert not result.observed.any() and not result.significant
    assert sorted(result.open) == sorted(
        f"{component} of radar {one} + {component} of radar {3 - one}"
        for component, one in zip(("range", "bearing", "elevation"), _leads(result), strict=True)
    )
    # differences are known well
    for i in range(3):
        both = np.zeros(6)
        both[i], both[i + 3] = 1.0, -1.0
        assert np.sqrt(both @ result.covariance @ both) < 0.1 * result.spreads[i]


def _leads(result):
    """Which radar each line names first: either is right."""
    first = {line.split()[0]: int(line.split()[3]) for line in result.open}
    return [first[component] for component in ("range", "bearing", "elevation")]


@pytest.mark.slow
def test_clocks_only_by_their_differences():
    clocks = (0.5, -0.7, 0.2)
    scene = late_scene(radars(), clocks, scans=20)
    result = register(scene, components=("range", "azimuth", "elevation", "time"))
    own = np.array([result.of(s)["time"] for s in range(3)])
    np.testing.assert_allclose(own - own.mean(), np.array(clocks) - np.mean(clocks), atol=0.06)
    assert len(result.open) == 1 and result.open[0].count("time of") == 3
    again = register(result.correct(scene), components=("range", "azimuth", "elevation", "time"))
    left = np.array([again.of(s)["time"] for s in range(3)])
    assert np.abs(left - left.mean()).max() < 0.1


def test_places_need_a_reference():
    wrong = [{}, {"x": 200.0, "y": -150.0, "z": 80.0}, {"range": 100.0}]
    scene = with_biases(scene_of(radars(), 2, 20), wrong)
    result = register(scene, components=("range", "azimuth", "position"), reference=("1",))
    assert result.observed.all()
    off = result.biases - truth_of(result, wrong)
    assert (np.abs(off) < 4.5 * result.deviations).all()
    moved = result.correct(scene).sensors[1].position
    np.testing.assert_allclose(moved, scene_of(radars(), 2, 2).sensors[1].position, atol=120.0)
    free = register(scene, components=("range", "azimuth", "position"))
    named = " ".join(free.open)
    assert all(f"{axis} of radar" in named for axis in "xyz")


def test_bearings_with_times_of_their_own():
    """They are moved to a look's time by where their tuples are, and how these fly."""
    sensor = BearingSensor(position=[0.0, -60e3, 0.0], noise=np.array([2e-3]), name="bearings")
    _, where, velocity = paths(1, 2)
    before = sensor.measure(where[0] - 1.5 * velocity)
    moved = corrected_measurements(sensor, before, {}, velocity, np.full(len(before), 1.5), where[0])
    np.testing.assert_allclose(moved, sensor.measure(where[0]), rtol=1e-9)
    assert np.abs(moved - before).max() > 1e-3
    np.testing.assert_allclose(corrected_measurements(sensor, before, {}, velocity, 1.5), before, rtol=1e-12)
    # and a whole registration goes through with them
    plain = scene_of([*radars(2), sensor], 7, 4)
    times = [
        [np.full(len(z), time - 0.5 * (s == 2)) for s, z in enumerate(scan)]
        for time, scan in zip(plain.times.tolist(), plain.measurements, strict=True)
    ]
    late = Scene(plain.sensors, plain.times, plain.measurements, REGION, measurement_times=times)
    result = register(late)
    assert result.tuples > 20 and np.isfinite(result.biases).all()


def heard_scene(seed=3, share=0.75):
    """Turning secondary radars: of each, a quarter of the plots has no height, and is a sensor of its own."""
    sensors, biases = [], []
    for number, place in enumerate(on_circle(np.zeros(3), 60e3, 3)):
        both = {"position": place, "false_alarm_rate": 1.0}
        view = np.array([[0.0, 150e3], [-np.pi, np.pi], [-1e3, 2e4]])
        sensors += [
            Radar2D(noise=[50.0, 1e-3, 30.0], detection_probability=0.9 * share, name=f"r{number}",
                    field_of_view=view, **both),
            Radar2D(noise=[50.0, 1e-3], detection_probability=0.9 * (1 - share), name=f"r{number}{NO_HEIGHT}",
                    field_of_view=view[:2], **both),
        ]  # fmt: skip
        biases += [{"range": (150.0, -200.0, 100.0)[number], "azimuth": (number - 1) * 3e-3, "gain": 1e-3}] * 2
    rng = np.random.default_rng(seed)
    times, where, velocity = paths(seed, 61, interval=1.0)
    flights = [Path(k, times, where[:, k], np.tile(velocity[k], (len(times), 1))) for k in range(where.shape[1])]
    scene = observe_in_turns(sensors, [4.0, 4.0, 5.0, 5.0, 5.5, 5.5], 0.0, times[2::2], flights, rng, region=REGION)
    return with_biases(scene, biases), biases


def test_radars_whose_plots_have_heights_or_not():
    """Heights are heights, and no elevations; both sensors of a radar have its biases."""
    scene, biases = heard_scene()
    result = register(scene, components=("range", "azimuth", "gain"))
    assert len(result.terms) == 9 and {term.sensor for term in result.terms} == {0, 2, 4}
    off = result.biases - truth_of(result, biases)
    assert (np.abs(off) < 4.5 * result.deviations).all() and result.observed.all()
    assert all(result.of(s) == result.of(s + 1) for s in (0, 2, 4)) and result.noise < 1.2
    clean, corrected = with_biases(scene, [{k: -v for k, v in one.items()} for one in biases]), result.correct(scene)
    for s in range(6):
        parts = [np.concatenate([scan[s][:, :2] for scan in one.measurements]) for one in (corrected, clean)]
        assert np.abs(parts[0] - parts[1]).mean(axis=0) @ [1.0, 1e5] < 60.0


@pytest.mark.slow
def test_pairs_of_the_wrong_targets_count_little():
    """A third of the targets seen by the third radar 900 m off, too far for noise: the others decide."""
    scene = scene_of(radars(), 9, 20)
    measurements = [list(scan) for scan in scene.measurements]
    for k, scan in enumerate(measurements):
        away = scene.truth.sources[k][2] % 3 == 0
        z = np.array(scan[2])
        z[away, 0] += 900.0
        scan[2] = z
    result = register(Scene(scene.sensors, scene.times, measurements, REGION))
    assert np.abs([result.of(s)["range"] for s in range(3)]).max() < 40.0


def test_bad_input():
    scene = scene_of(radars(2), 1, 2)
    for values, match in (
        ({"components": "range"}, "components"),
        ({"components": 3}, "components: expected names, got 3"),
        ({"components": ("height",)}, "components: unknown 'height'"),
        ({"components": ("time",), "reference": ("1", "2")}, "no sensor has a bias"),
        ({"reference": ("nobody",)}, "reference: no sensor 'nobody'; there are radar 1, radar 2"),
        ({"range_spread": 0.0}, "range_spread"),
        ({"angle_spread": float("nan")}, "angle_spread"),
        ({"drift": -1.0}, "drift"),
        ({"size": 1.0}, "size"),
    ):
        with pytest.raises(InvalidInputError, match=match):
            register(scene, **values)
    with pytest.raises(InvalidInputError, match="Scene"):
        register("scene.npz")
    with pytest.raises(InvalidInputError, match="sensor 7"):
        register(scene).of(7)
    assert RegistrationParameters(components=["range"]).components == ("range",)


def test_files(found, tmp_path):
    found.to_json(tmp_path / "biases.json")
    content = json.loads((tmp_path / "biases.json").read_text())
    assert content["format"] == "assoc.registration" and len(content["biases"]) == 9
    first = content["biases"][1]
    # azimuths 0.3 degrees too small are bearings 0.3 degrees too far clockwise
    assert first["component"] == "bearing" and first["unit"] == "deg" and first["bias"] == pytest.approx(0.3, abs=0.03)
    assert first["sigma"] > 0.0
    said = found.advice()
    assert "radar 1: ranges are" in said[0] and re.search(
        r"bearings are 0\.[23]\d* deg too far clockwise, subtract", said[0]
    )
    assert re.search(
        r"ranges are 2\d\d m too short, add 2\d\d m; bearings are 0\.\d+ deg too far counter-clockwise", said[1]
    )
    assert np.sqrt(content["covariance"][1][1]) == pytest.approx(first["sigma"])
    frame = found.to_frame()
    assert list(frame.columns) == ["sensor", "component", "unit", "bias", "sigma", "observed"]


def test_late_measurements_are_left_out():
    """A third of a radar's measurements come three scans late: they would take their look before the one before."""
    scene = scene_of(radars(2), 3, 6)
    measurements = [list(scan) for scan in scene.measurements]
    times = [[np.full(len(z), time) for z in scan] for scan, time in zip(measurements, scene.times, strict=True)]
    for rows in (measurements, times):
        for k in range(3):
            cut = len(scene.measurements[k][0]) // 3
            rows[k + 3][0] = np.concatenate([rows[k + 3][0], rows[k][0][:cut]])
            rows[k][0] = rows[k][0][cut:]
    late = Scene(scene.sensors, scene.times, measurements, REGION, measurement_times=times)
    looks = scene_epochs(late, moving=False)
    assert [one.time for one in looks] == scene.times.tolist()
    assert all((own == look.time).all() for look in looks for own in look.times)
    assert np.isfinite(register(late).biases).all()


def test_the_shift_of_many_sensors_together_is_named():
    """Each of 30 has a small part in it."""
    view = [[-1e5, 1e5]] * 2
    sensors = [PositionSensor(position=np.zeros(3), noise=[20.0] * 2, field_of_view=view) for _ in range(30)]
    named = describe(np.full(30, 30**-0.5), [Term(s, "x") for s in range(30)], sensors)
    assert named == "x of sensor 1 + x of sensor 2 + x of sensor 3 + x of sensor 4 ..."


def test_heading_and_position_of_platforms():
    """A ship whose compass and position are off by the same all the time, beside a radar on land."""
    seconds = np.arange(60.0)
    heading = 0.5 + 0.02 * seconds
    way = np.cumsum(12.0 * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1), axis=0)
    ship = Platform(seconds, way + [20e3, -10e3, 0], heading)
    view = [[0, 2e5], [-np.pi, np.pi], [-0.2, 1.5]]
    on_board = Radar3D(position=[8, 0, 25], noise=[50, 1e-3, 1e-3], field_of_view=view, name="ship", platform=ship)
    aside = PositionSensor(
        position=[-8, 0, 9], noise=[60, 60, 60], field_of_view=[[-9e4, 9e4], [-9e4, 9e4], [0, 12e3]], name="lidar",
        platform=Platform(seconds, ship.positions),
    )  # fmt: skip
    scene = scene_of([radars(1)[0], on_board, aside])
    offset, turn = np.array([150.0, -100.0, 40.0]), np.radians(0.3)
    stated = Platform(seconds, ship.positions + offset, heading + turn)
    north = replace(stated, headings=None)
    told = replace(
        scene, sensors=[scene.sensors[0], replace(on_board, platform=stated), replace(aside, platform=north)]
    )
    found = register(told, components=("azimuth", "position"), reference=("radar 1",))
    assert found.of(1).keys() == {"azimuth", "x", "y", "z"} and found.of(2).keys() == {*"xyz"}
    truth = np.array([{"azimuth": turn, **dict(zip("xyz", offset, strict=True))}[one.component] for one in found.terms])
    off = found.biases - truth
    assert found.observed.all() and (np.abs(off) < 4.5 * found.deviations).all() and 0.9 < found.noise < 1.1
    assert found.deviations.max() < 25.0 and np.degrees(found.deviations.min()) < 0.02
    for sensor, true in zip(found.correct(told).sensors, scene.sensors, strict=True):
        assert np.abs(sensor.at(30.0).position - true.at(30.0).position).max() < 60.0
    with pytest.raises(InvalidInputError, match="on platforms scans of one instant"):
        register(replace(told, sectors=np.tile([-np.pi, np.pi], (15, 3, 1))))
    with pytest.raises(InvalidInputError, match="platform with headings cannot be registered"):
        register(replace(told, sensors=[*told.sensors[:2], replace(aside, platform=ship)]))


@pytest.mark.parametrize("gain", [2e-3, -1e-3])
def test_gain_of_ranges(gain):
    truth = [{"range": 120.0, "gain": gain}, {"azimuth": 0.002}, {"range": -80.0}]
    scene = with_biases(scene_of(radars(3), seed=4), truth)
    found = register(scene, components=("range", "gain", "azimuth"))
    off = found.biases - truth_of(found, truth)
    assert (np.abs(off) < 4.5 * found.deviations).all()
    mine = [term.component == "gain" for term in found.terms]
    assert found.deviations[mine].max() < 5e-4 and found.to_frame()["unit"][np.flatnonzero(mine)[0]] == "m/km"
    # without the gain ranges stay wrong
    left = found.correct(scene).measurements[0][0][:, 0] - scene_of(radars(3), seed=4).measurements[0][0][:, 0]
    short = (
        register(scene).correct(scene).measurements[0][0][:, 0] - scene_of(radars(3), seed=4).measurements[0][0][:, 0]
    )
    assert np.abs(left).max() < 0.5 * np.abs(short).max()


@pytest.mark.slow
def test_residuals_are_those_of_the_noise_where_an_antenna_turns_twice_as_fast():
    """Its better fitting one of two plots would leave residuals, and deviations told, that are too small."""
    scenes = [simulate("rotating-radars", seed, turns="4,8", aircraft=20, duration=160.0) for seed in (3, 4, 5)]
    assert np.mean([register(scene).noise for scene in scenes]) == pytest.approx(1.0, abs=0.06)
