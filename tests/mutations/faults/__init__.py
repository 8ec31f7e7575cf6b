"""The faults: what text becomes what in which file, and the test file that must fail then.

Each old text occurs exactly once in its file (test_faults_fit.py); where the code changes, the fault changes
with it.
"""

from __future__ import annotations

from tests.mutations.faults import ant_colony, genetic, pairs, ranking, shared, tabu, tracking
from tests.mutations.faults.fault import Fault

FAULTS: tuple[Fault, ...] = (
    *ant_colony.FAULTS, *genetic.FAULTS, *tabu.FAULTS, *shared.FAULTS, *tracking.FAULTS, *pairs.FAULTS,
    *ranking.FAULTS,
)  # fmt: skip
