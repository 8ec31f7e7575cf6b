"""Range rates: smaller errors of the velocity in all trackers, and crossing targets that keep their tracks."""

import numpy as np

from assoc import simulation
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
