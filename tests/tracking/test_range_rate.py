"""Range rates: smaller errors of the velocity in all trackers, and crossing targets that keep their tracks."""

import numpy as np

from assoc import simulation
from assoc.sensors import Radar3D
from assoc.simulation.observation import observe
from assoc.simulation.scenarios.three_radar import TRAJECTORIES
from assoc.tracking import TRACKERS
from tests.sizes import sample

SCANS = 20


def velocity_errors(name, noise):
    scene = simulation.simulate("three-radar", 5, scans=SCANS, range_rate_noise=noise)
    tracker, errors = TRACKERS[name].for_scene(scene), []
    for k in range(SCANS):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements)
        places, speeds = (
            np.concatenate([getattr(one, what)([scan.time]) for one in TRAJECTORIES])
            for what in ("positions", "velocities")
        )
        for track in tracker.tracks if k >= 5 else ():
            if track.confirmed:
                own = int(np.argmin(np.linalg.norm(places - track.position, axis=1)))
                errors.append(float(np.linalg.norm(speeds[own] - track.velocity)))
    return np.array(errors)


@sample("name", TRACKERS, every=6)
def test_velocities_are_better(name):
    plain, doppler = velocity_errors(name, 0.0), velocity_errors(name, 0.5)
    assert len(doppler) >= 0.95 * len(plain) > 3 * 10
    assert np.median(doppler) < 0.5 * np.median(plain)


def crossing(doppler, seed):
    """Two targets fly through each other head-on, closer than the noise; one radar looks along their path."""
    view = [[0, 2e5], [-4, 2], [-1, 1.5], [-400, 400]]
    radar = Radar3D(
        position=[0, 0, 0], noise=[150, 8e-3, 8e-3, 1.0], field_of_view=view, false_alarm_rate=0.5,
        detection_probability=0.8,
    )  # fmt: skip
    radar = radar if doppler else radar.position_part
    times = np.arange(30.0)
    start, velocity = np.array([[20e3, 0, 2e3], [26e3, 100, 2e3]]), np.array([[200.0, 0, 0], [-200.0, 0, 0]])
    places, speeds = [start + t * velocity for t in times], [velocity] * len(times)
    rng = np.random.default_rng(seed)
    return observe([radar], times, [np.arange(2)] * len(times), places, rng, velocities=speeds)
