"""What the parts of `aco`, `genetic` and `tabu` contribute, and which of their settings are best where."""

import os

# one thread for numerical libraries, before they are loaded: a run is to have one core
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
