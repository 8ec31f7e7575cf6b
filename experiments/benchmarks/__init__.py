"""Benchmarks against other solvers: ``python -m experiments.benchmarks``.

Instances come from `experiments.common.instances` by family, size and seed. All run after warm-up; ours are pinned to
one core and timed from the tuples to the Solution; peers run on the same tuples in the same process, with both cores
where they can use them.
"""

import os

# one thread for numerical libraries, before they are loaded: our solvers are measured on one
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
