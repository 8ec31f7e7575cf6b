"""Tracks of several systems as one picture: intersection and costs against formulas, ids over time."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from assoc import InvalidInputError
from assoc.tracking.fusion import FusionParameters, SystemTracks, TrackFusion, fuse_tables, intersected

COVARIANCE = np.diag([50.0, 50.0, 80.0, 5.0, 5.0, 5.0]) ** 2


def random_covariances(rng, count):
    roots = rng.normal(0, 1, (count, 6, 6))
    return roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(6)


def tracks_of(ids, places, velocity=(100.0, 0.0, 0.0), covariance=COVARIANCE):
    places = np.asarray(places, dtype=float).reshape(-1, 3)
    mean = np.column_stack([places, np.tile(velocity, (len(places), 1))])
    return SystemTracks(np.array(ids), mean, np.tile(covariance, (len(ids), 1, 1)), np.full(len(ids), 0.9))


@pytest.mark.parametrize("count", [2, 3])
def test_an_intersection_has_the_weights_of_least_determinant(count):
    rng = np.random.default_rng(count)
    for _ in range(5):
        P, x = random_covariances(rng, count), rng.normal(0, 1, (count, 6))
        inverse = np.linalg.inv(P)

        def volume(w, inverse=inverse):
            w = np.abs(w) / np.abs(w).sum()
            return -np.linalg.slogdet(np.einsum("s,sij->ij", w, inverse))[1]

        best = min(minimize(volume, rng.random(count), method="Nelder-Mead").fun for _ in range(3))
        mean, covariance = intersected(x[None], P[None], np.ones((1, count), dtype=bool))
        assert np.linalg.slogdet(covariance[0])[1] == pytest.approx(best, abs=0.02)
        # some weighted sum of the inverses, and the mean that belongs to it
        w = np.linalg.lstsq(inverse.reshape(count, -1).T, np.linalg.inv(covariance[0]).ravel(), rcond=None)[0]
        assert w.min() > -1e-9 and w.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(mean[0], covariance[0] @ np.einsum("s,sij,sj->i", w, inverse, x))


@pytest.mark.parametrize("share", [0.0, 0.5, 0.95])
def test_an_intersection_is_never_too_sure(share):
    """Whatever share of the errors two systems have in common; summed information is too sure."""
    rng = np.random.default_rng(1)
    common, own = np.sqrt(share) * rng.normal(0, 1, (2000, 1, 6)), np.sqrt(1 - share) * rng.normal(0, 1, (2000, 2, 6))
    P = np.broadcast_to(np.diag([1.0, 4.0, 9.0, 1.0, 1.0, 1.0]), (2000, 2, 6, 6))
    x = (common + own) * np.sqrt(np.diagonal(P, axis1=2, axis2=3))
    mean, covariance = intersected(x, P, np.ones((2000, 2), dtype=bool))
    square = np.einsum("gi,gij,gj->g", mean, np.linalg.inv(covariance), mean).mean()
    assert square < 6.3
    if share > 0.9:
        assert 2.0 * square > 11.0


@pytest.mark.parametrize("count", [2, 3])
def test_costs_are_those_of_the_formula(count):
    rng, chosen = np.random.default_rng(3), FusionParameters(density=1e-12, coverage=0.8)
    P, x = 1e3 * random_covariances(rng, count), rng.normal(0, 40, (count, 6))
    tracks = [SystemTracks(np.array([7]), x[s : s + 1], P[s : s + 1], np.ones(1)) for s in range(count)]
    solution = TrackFusion(count, chosen).step(0.0, tracks).solution
    # one after the other: each is a measurement of what is known by those before it
    known, spread, log = x[0], P[0], 0.0
    for s in range(1, count):
        log += multivariate_normal(known, spread + P[s]).logpdf(x[s])
        gain = spread @ np.linalg.inv(spread + P[s])
        known, spread = known + gain @ (x[s] - known), spread - gain @ spread
    b = 1e-12 / (np.sqrt(2 * np.pi) * 300.0) ** 3
    assert solution.cost == pytest.approx((count - 1) * (np.log(b) + count * np.log(0.2)) - log)
    assert solution.status == "optimal"


def test_ids_are_kept_while_systems_lose_tracks_and_rename_them():
    """Two targets 600 m apart; what each of two systems calls them, 0 where it has lost them."""
    fusion, seen = TrackFusion(2), []
    first = [[1, 2], [1, 2], [1, 2], [1, 2], [0, 2], [0, 0], [3, 2], [3, 4]]
    second = [[5, 6], [5, 6], [0, 6], [9, 6], [9, 6], [0, 0], [9, 8], [11, 12]]
    for k, names in enumerate(zip(first, second, strict=True)):
        places = np.array([[0.0, 0.0, 5e3], [0.0, 600.0, 5e3]]) + [400.0 * k, 0.0, 0.0]
        found = []
        for s, ids in enumerate(names):
            there = np.flatnonzero(ids)
            found.append(tracks_of(np.array(ids)[there], places[there] + [0.0, 20.0 * s, 0.0]))
        picture = fusion.step(4.0 * k, found)
        expected = {i for one in zip(*names, strict=True) for i in [one] if any(one)}
        assert {tuple(row) for row in picture.members.tolist()} == expected
        seen.append({track.track_id: round(track.position[1] / 600.0) for track in picture.tracks})
        assert picture.solution.gap < 1e-6
    assert [one for one in seen if one] == [{1: 0, 2: 1}] * 7


def test_tables_of_systems_become_one(tmp_path):
    """Two systems, other times, one without standard deviations, as category 062."""
    import pandas as pd

    def table(times, places, ids):
        rows = [
            (i, t, x + 150.0 * t, y, z, 150.0, 0.0, 0.0, True)
            for t in times for i, (x, y, z) in zip(ids, places, strict=True)
        ]  # fmt: skip
        return pd.DataFrame(rows, columns=["track_id", "time", "x", "y", "z", "vx", "vy", "vz", "confirmed"])

    places = np.array([[0.0, 0.0, 4e3], [0.0, 5e3, 6e3], [0.0, 20e3, 6e3]])
    first = table(np.arange(0.0, 40.0, 4.0), places[:2], [1, 2])
    second = table(np.arange(1.0, 40.0, 5.0), places[1:] + [30.0, 0.0, 0.0], [1, 2])
    path = tmp_path / "tracks.csv"
    first.assign(sigma_x=60.0, sigma_y=60.0, sigma_z=90.0, existence=0.9).to_csv(path, index=False)
    fused = fuse_tables([path, second]).to_frame()
    assert set(fused["track_id"]) == {1, 2, 3}
    last = fused[fused["time"] == fused["time"].max()].set_index("track_id")
    np.testing.assert_allclose(np.sort(last["y"]), places[:, 1], atol=1.0)
    assert (np.abs(last["x"] - 150.0 * last["time"]) < 40.0).all()
    # the common target is known better than the second system's own
    assert last["sigma_x"].min() < 0.9 * last["sigma_x"].max()


ONE = tracks_of([1], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TrackFusion(0), "systems must be a whole number above 0, got 0"),
        (lambda: TrackFusion(2).step(0.0, [ONE]), "tracks: expected those of 2 systems, got 1"),
        (lambda: TrackFusion(1).step(0.0, [ONE._replace(ids=np.array([0]))]), "system 0: expected different ids"),
        (lambda: TrackFusion(1).step(0.0, [ONE._replace(covariance=-ONE.covariance)]), "system 0: .* definite"),
        (lambda: TrackFusion(1).step(0.0, [ONE._replace(mean=ONE.mean[:, :4])]), r"system 0: expected shapes"),
        (lambda: FusionParameters(coverage=1.0), "coverage must be below 1, got 1.0"),
        (lambda: fuse_tables([3]), "table 1: expected a TrackTable, a DataFrame or a path, got int"),
    ],
)  # fmt: skip
def test_wrong_input_is_one_line(call, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
