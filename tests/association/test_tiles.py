"""A scan in tiles costs what it costs in one piece, with one certificate."""

import numpy as np
import pytest

import assoc
from assoc.association.plan import Plan
from assoc.association.tiles import tiles_of
from assoc.simulation import simulate
from tests.sizes import sample


@pytest.fixture(scope="module")
def crowd():
    return simulate("crowd", 3, targets=400, scans=1, constant_density=True)


@sample("scenario, tiles, jobs", [("crowd", 20, 1), ("crowd", 20, 2), ("crowd", 2, 1), ("three-radar", 3, 1)], every=3)
def test_tiles_change_neither_targets_nor_cost(crowd, scenario, tiles, jobs):
    scene = crowd if scenario == "crowd" else simulate(scenario, 1, scans=1)
    (one,) = assoc.associate(scene).scans
    plan = Plan((scene,), "exact", tiles=tiles)
    (cut,) = plan.run(plan.items(), jobs)
    assert cut.solution.status == one.solution.status == "optimal"
    assert cut.solution.cost == pytest.approx(one.solution.cost, rel=1e-12)
    assert cut.solution.lower_bound == pytest.approx(one.solution.lower_bound, rel=1e-9)
    np.testing.assert_array_equal(cut.solution.tuples, one.solution.tuples)
    np.testing.assert_array_equal(cut.targets, one.targets)
    np.testing.assert_allclose(cut.positions, one.positions)
    assert cut.correct_tuples == one.correct_tuples


def test_components_cross_the_borders_of_tiles(crowd):
    """Otherwise the tests above would show nothing."""
    scan = crowd.scan(0)
    tiles = list(tiles_of(crowd, scan, 20, 0.999))
    owned = np.zeros((len(scan.sizes), max(scan.sizes)), dtype=int)
    of = np.full_like(owned, -1)
    for number, tile in enumerate(tiles):
        for s, (rows, own) in enumerate(zip(tile.rows, tile.belongs, strict=True)):
            owned[s, rows[own]] += 1
            of[s, rows[own]] = number
    assert all((owned[s, :size] == 1).all() for s, size in enumerate(scan.sizes))
    assert max(sum(map(len, tile.rows)) for tile in tiles) < scan.sizes.sum()
    problem = assoc.build_problem(crowd, 0)
    crossing = 0
    for component in problem.components():
        which, sensor = np.nonzero(problem.tuples[component])
        crossing += len({*of[sensor, problem.tuples[component][which, sensor] - 1]}) > 1
    assert crossing >= 10


@pytest.mark.parametrize(
    ("kind", "options"),
    [("crowd", {"gating": {"gate_probability": 1.0}}), ("crowd", {"kbest": 2}), ("rotating-radars", {})],
)
def test_what_has_no_tiles_is_refused(kind, options):
    scene = simulate(kind, 1, scans=1) if kind == "crowd" else simulate(kind, 1)
    plan = Plan((scene,), "exact", tiles=2, **options)
    with pytest.raises(assoc.InvalidInputError, match="tiles: expected measurements of one instant"):
        list(plan.run(plan.items()[:1]))
