"""The experiments with filters as programs: their claims, JSON and figures, at their quick size."""

import numpy as np
import pytest

from assoc.simulation.dubins.paths import Pose, path, shortest
from experiments.filters import manoeuvres
from experiments.papers.dubins_enkf import along_path, ensemble, flight_paths
from experiments.papers.fuzzy_ekf import other_models, published, tuned_once
from experiments.papers.modified_ekf import beyond, paper_setting


def test_what_the_papers_leave_open_in_small():
    rng = np.random.default_rng(0)
    judged = beyond.about_samples(20_000, rng) + beyond.about_filters(40, rng) + beyond.about_matrices(rng)
    assert [claim.quantity for claim in judged if claim.holds is False] == []
    # without noise an aircraft that steers by its estimate stays on its path
    little = np.full(3, 1e-6)
    straight = shortest(flight_paths.FIRST, flight_paths.LAST, 100.0)
    squares = along_path.fly(straight, None, rng, disturbed=little, measured=little)
    assert squares.max() < 1.0
    fine = other_models.GRIDS["Singer"]
    grids = {"Singer": fine[:2], "jerk": other_models.GRIDS["jerk"][:2]}
    claims = other_models.experiment(True, rng, grids=grids, scenarios=manoeuvres.NEW_SCENARIOS)
    found = {claim.quantity: claim.ours for claim in claims}
    assert found["Singer: standard deviation"] == fine[0][1] and len(found) == 10


def test_the_fuzzy_filter_is_equations_21_to_36_but_for_r_in_alpha():
    batch = manoeuvres.Batch.draw([manoeuvres.SCENARIOS["E"]], 2, np.random.default_rng(0))
    found = manoeuvres.errors(published.published_filter(published.tuned()), batch)
    assert found == pytest.approx(tuned_once.by_equations(published.tuned(), batch, current=False), rel=1e-6)
    assert found != pytest.approx(tuned_once.by_equations(published.tuned(), batch, current=True), rel=1e-3)


@pytest.mark.parametrize(("word", "backwards"), [("RSR", "LSL"), ("LSR", "LSR"), ("RSL", "RSL"), ("LSL", "RSR")])
def test_dubins_lengths_by_the_papers_steps(word, backwards):
    first, last = flight_paths.FIRST, flight_paths.LAST
    one = path(first, last, 100.0, word)
    assert flight_paths.by_steps(first, last, (100.0, 100.0), word) == pytest.approx(one.length)
    # the same way flown from its end, with another radius at each end
    back = [Pose(pose.x, pose.y, pose.heading + np.pi) for pose in (last, first)]
    there = flight_paths.by_steps(first, last, (100.0, 50.0), word)
    assert there == pytest.approx(flight_paths.by_steps(*back, (50.0, 100.0), backwards)) != pytest.approx(one.length)
    # equation 7: no tangent passes between circles that meet
    assert (flight_paths.by_steps(Pose(0, 0, 0), Pose(50, 0, np.pi), (100, 50), word) is None) == (word[0] != word[2])


def test_what_is_misprinted_can_be_run():
    aircraft = [kind(3000.0, 0.03, np.eye(4)) for kind in (ensemble.UnmannedAircraft, ensemble.AsPrinted)]
    ours, printed = (one.rates(ensemble.START[None])[0] for one in aircraft)
    k = aircraft[0].aerodynamics
    drag = 0.5 * np.polyval(k.density, 150.0) * 272.0**2 * k.area * np.polyval(k.drag, 0.03)
    # the printed thrust has no drag to carry when it points up, and all of it along the path
    assert printed[0] - ours[0] == pytest.approx(drag * np.sin(0.03) / (k.mass * 272.0))
    assert printed[1] - ours[1] == pytest.approx(-drag * (1 - np.cos(0.03)) / k.mass)
    seen = paper_setting.radar_of(paper_setting.SIGMAS).measure(paper_setting.START[None, :3])[None].repeat(2, axis=0)
    spreads = [
        paper_setting.follow(
            paper_setting.ExtendedKalmanFilter(paper_setting.motion_of("sigmas")),
            paper_setting.radar_of(paper_setting.SIGMAS), seen, printed=printed,
        )[1]
        for printed in (False, True)
    ]  # fmt: skip
    p, q = paper_setting.P0, paper_setting.Q
    # A is nearly the unit matrix: A P + P A' is 2 P
    assert spreads[1] / spreads[0] == pytest.approx((2 * p + q) / (p + q), rel=1e-3)
