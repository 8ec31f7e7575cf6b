"""Parameter studies: a design of settings, run on one core, on all, or on a cluster; every result is saved at once.

>>> import assoc.sweeps
>>> frame = assoc.sweeps.load("study/")    # one row per run, doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._system.imports import lazy_names

if TYPE_CHECKING:
    from assoc.sweeps.design import Setting, grid
    from assoc.sweeps.frame import load, load_traces
    from assoc.sweeps.study import Study
    from assoc.sweeps.summary import compare, summarize
    from assoc.sweeps.tuning import tune

__all__ = [
    "Setting",
    "Study",
    "compare",
    "grid",
    "load",
    "load_traces",
    "summarize",
    "tune",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "design": "Setting grid",
        "frame": "load load_traces",
        "study": "Study",
        "summary": "compare summarize",
        "tuning": "tune",
    },
)
