"""Small studies for the tests of sweeps."""

import pytest

from assoc.simulation import simulate
from assoc.sweeps import Study, grid
from assoc.sweeps.sources import StudySource


@pytest.fixture(scope="session")
def scene():
    return simulate("three-radar", 2, scans=5)


@pytest.fixture
def study(scene):
    """Ant colony of the paper: 4 settings, 2 repeats, 5 scans."""
    settings = grid("aco", {"mode": ["paper"], "alpha": [1, 2], "rho": [0.3, 0.9]})
    return Study([StudySource(scene, "scene")], settings, 2)
