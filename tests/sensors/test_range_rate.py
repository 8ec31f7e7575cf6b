import math
from dataclasses import replace

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.sensors.codes import RADAR3D
from assoc.sensors.kernels.dispatch import linearise_moving, measure_moving, wrap
from assoc.simulation.observation import observe

VIEW = [[0, 1e6], [-math.pi, math.pi], [-math.pi / 2, math.pi / 2], [-500, 500]]
RADAR = Radar3D(position=[100, -200, 30], noise=[50, 1e-3, 2e-3, 0.5], field_of_view=VIEW)


def states(count=40, seed=0):
    rng = np.random.default_rng(seed)
    return np.hstack([rng.uniform(-1e4, 1e4, (count, 3)), rng.normal(0, 200, (count, 3))])


def test_jacobian_is_the_derivative_of_the_measurement():
    x = states()
    H = RADAR.jacobian(x[:, :3], x[:, 3:])
    for axis in range(6):
        step = np.eye(6)[axis] * 1e-2
        ends = [RADAR.measure((x + sign * step)[:, :3], (x + sign * step)[:, 3:]) for sign in (1, -1)]
        np.testing.assert_allclose(H[:, :, axis], RADAR.residual(*ends) / 2e-2, rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize("axes", [2, 3])
def test_compiled_model_is_the_sensor(axes):
    x = states()
    if axes == 2:
        x[:, [2, 5]] = 0.0
    read = [0, 1, 3, 4] if axes == 2 else list(range(6))
    # the state in another order than the columns are read
    order = np.random.default_rng(1).permutation(2 * axes)
    columns = np.argsort(order)
    h, H = np.zeros(4), np.ones((4, 2 * axes))
    slopes = RADAR.jacobian(x[:, :3], x[:, 3:])[:, :, read]
    for state, z, slope in zip(x, RADAR.measure(x[:, :3], x[:, 3:]), slopes, strict=True):
        linearise_moving(RADAR.position, state[read][order], columns, h, H)
        np.testing.assert_allclose(h, z, rtol=1e-14, atol=1e-12)
        np.testing.assert_allclose(H, slope, rtol=1e-12, atol=1e-15)
        h[:] = 0
        measure_moving(RADAR.position, state[read][order], columns, h)
        np.testing.assert_allclose(h, z, rtol=1e-14, atol=1e-12)
    v = np.array([1.0, 4.0, 5.0, 6.0])
    wrap(RADAR3D, v)
    np.testing.assert_allclose(v, [1.0, 4.0 - 2 * math.pi, 5.0, 6.0])


def test_folded_rates_and_the_notch():
    folding = replace(RADAR, folding=90.0, notch=10.0)
    x = states()
    exact = RADAR.measure(x[:, :3], x[:, 3:])
    rate = folding.folded(exact)[:, 3]
    np.testing.assert_allclose(np.exp(2j * np.pi * rate / 90.0), np.exp(2j * np.pi * exact[:, 3] / 90.0), atol=1e-9)
    assert rate.min() >= -45.0 and rate.max() < 45.0
    assert folding.folded(np.array([[1.0, 2.0, 3.0, 45.0]]))[0, 3] == -45.0
    np.testing.assert_allclose(folding.residual(folding.folded(exact), exact), 0.0, atol=1e-9)
    np.testing.assert_array_equal(folding.sees(exact), np.abs(rate) >= 10.0)
    assert folding != RADAR and folding.position_part == RADAR.position_part
    for change, said in (({"folding": 0.0}, "folding must be a number above 0"), ({"notch": -1.0}, "notch must be"),
                         ({"folding": 10.0, "notch": 5.0}, "below half")):  # fmt: skip
        with pytest.raises(InvalidInputError, match=said):
            replace(RADAR, **change)
    with pytest.raises(InvalidInputError, match="needs a range rate"):
        replace(RADAR.position_part, folding=90.0)


def test_scenes_with_folded_rates_and_notches(tmp_path):
    sensors = [replace(RADAR, folding=90.0, notch=10.0, false_alarm_rate=1e-9), replace(RADAR, folding=math.inf), RADAR]
    x = states()
    scene = observe(sensors, [0.0, 1.0], [np.arange(40)] * 2, [x[:, :3]] * 2, np.random.default_rng(0),
                    velocities=[x[:, 3:]] * 2)  # fmt: skip
    rates = np.concatenate([scan[0][:, 3] for scan in scene.measurements])
    assert len(rates) and np.abs(rates).max() <= 45.0 and np.abs(rates).min() > 10.0 - 5 * 0.5
    for number, some in enumerate((sensors, [RADAR])):
        part = Scene(some, scene.times, [scan[-len(some) :] for scan in scene.measurements], scene.region)
        part.save(f"{tmp_path}/{number}.npz")
        with np.load(f"{tmp_path}/{number}.npz") as file:
            assert int(file["version"]) == (4, 1)[number]
            assert ("sensor_folding" in file) == (number == 0)
        assert list(Scene.load(f"{tmp_path}/{number}.npz").sensors) == some
