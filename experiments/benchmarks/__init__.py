"""Benchmarks against other solvers: ``python -m experiments.benchmarks``.

Instances come from `experiments.common.instances` by family, size and seed; seeds from 1000 on are reported and were
used for no tuning (0 to 99 are for that). Our solvers run after warm-up, pinned to one core, and are timed
from the tuples to the Solution; peers (`experiments.common.peers`) run on the same tuples in the same process, with
both cores where they can use them.
"""

FIRST_SEED = 1000
