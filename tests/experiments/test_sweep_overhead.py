"""The measurement of a study's overhead, on the smallest study."""

from assoc.simulation import simulate
from assoc.sweeps import Study
from assoc.sweeps.sources import StudySource
from experiments import sweep_overhead


def test_overhead_in_one_process():
    scene = StudySource(simulate("three-radar", 1, scans=5), "scene")
    study = Study([scene], [sweep_overhead.KINDS["greedy"]], 100)
    overhead, processor, start, solving = sweep_overhead._overhead(study, "one process")
    assert min(overhead, processor, solving, start) > 0.0
