"""The judge of air traffic: its judgements by hand, and a short run."""

from argparse import Namespace

import numpy as np
import pytest

from experiments.real import air_traffic


def test_wrong_plots_and_mixed_tracks_by_hand():
    # track 1: three of aircraft 0 (paths 0 and 2), one of aircraft 1, one false; track 2: aircraft 1; one plot left out
    found, leaders = air_traffic.judged(
        np.array([1, 1, 1, 1, 1, 2, 2, 0]), np.array([0, 0, 2, 1, -1, 1, 1, 1]), np.array([0, 1, 0])
    )
    assert found == pytest.approx((100 * 2 / 7, 50.0, 100 / 7, 1.0)) and leaders == {1: 0, 2: 1}


@pytest.mark.slow
def test_a_short_run(capsys):
    chosen = Namespace(file=None, names=["simulated"], quick=True, seed=100, seeds=1)
    claims = {c.quantity: c.ours for c in air_traffic.experiment(chosen)}
    start = "simulated flights, 20% primary only"
    assert claims[f"{start}, plots, registered: RMSE"] < 0.7 * claims[f"{start}, plots as they come: RMSE"]
    assert claims[f"{start}, assoc: wrong plots"] < 1.0


@pytest.mark.slow
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
