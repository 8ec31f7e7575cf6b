"""The judge of air traffic: its peer by hand, its judgements by hand, and a short run."""

import numpy as np
import pytest

from assoc.scene import Scene
from assoc.sensors import Radar2D
from experiments.real import air_traffic


def test_wrong_plots_and_mixed_tracks_by_hand():
    # track 1: three of aircraft 0 (paths 0 and 2), one of aircraft 1, one false; track 2: aircraft 1; one plot left out
    found, leaders = air_traffic.judged(
        np.array([1, 1, 1, 1, 1, 2, 2, 0]), np.array([0, 0, 2, 1, -1, 1, 1, 1]), np.array([0, 1, 0])
    )
    assert found == pytest.approx((100 * 2 / 7, 50.0, 100 / 7, 1.0)) and leaders == {1: 0, 2: 1}


def test_address_code_and_distance_by_hand():
    """Two aircraft with addresses, 10 km apart; what has none goes to the nearest that nothing speaks against."""
    views = np.array([[0.0, 1e6], [-np.pi, np.pi], [-1e4, 1e5]])
    high = Radar2D(position=np.zeros(3), noise=[50.0, 1e-3, 30.0], field_of_view=views, name="radar 1")
    low = Radar2D(position=np.zeros(3), noise=[50.0, 1e-3], field_of_view=views[:2], name="radar 1, no height")

    def at(x, y, z):
        return [float(np.hypot(np.hypot(x, y), z)), float(np.arctan2(y, x)), z]

    heard = [at(100e3, 0.0, 9e3), at(100e3, 10e3, 9e3), at(100e3, 1e3, 9050.0), at(100e3, 1e3, 9500.0)]
    codes = [[0o1000, 7], [0o2000, 8], [0, 0], [0, 0]]
    # no altitude: its slant range is taken for its distance on the ground
    silent = [at(100e3, 9e3, 0.0)[:2], at(100e3, 9e3, 0.0)[:2], at(100e3, 5e3, 0.0)[:2]]
    times = [[np.full(4, 9.0), np.full(3, 9.5)]]
    scene = Scene([high, low], [10.0], [[np.array(heard), np.array(silent)]], measurement_times=times)
    known = [(np.array(codes), np.array([[0, 0], [0o1000, 0], [0, 0]]))]
    seen = air_traffic.Observed(scene, known, [[np.zeros(4, int), np.zeros(3, int)]], scene)
    # the fourth is 500 m higher; the sixth has the code of the aircraft 9 km away; the seventh is near to none
    assert air_traffic.by_distance(seen, scene, None).tolist() == [1, 2, 1, 0, 2, 0, 0]


@pytest.mark.slow
def test_a_short_run(capsys):
    claims = {c.quantity: c.ours for c in air_traffic.experiment(None, ["simulated"], True, 100)}
    start = "simulated flights, 20% primary only"
    assert claims[f"{start}, plots, registered: RMSE"] < 0.7 * claims[f"{start}, plots as they come: RMSE"]
    assert claims[f"{start}, assoc: wrong plots"] < 1.0


def test_plots_have_the_errors_and_no_others():
    """With the true errors taken off, plots are off by the noise alone; a silent aircraft has nothing to name it."""
    traffic = air_traffic.simulated(0, 30.0)
    seen = air_traffic.observed(traffic, 0.5, 30.0, 0)
    noise = air_traffic.plot_errors(seen, seen.exact, traffic)
    assert (noise < 230.0).all() and (noise < air_traffic.plot_errors(seen, seen.scene, traffic)).all()
    known = np.concatenate([rows for scan in seen.identities for rows in scan])
    sources = np.concatenate([rows for scan in seen.sources for rows in scan])
    heard, silent = (set(sources[(known[:, 1] > 0) == flag].tolist()) for flag in (True, False))
    assert not heard & silent and len(silent - {-1}) == len(heard) == 20
