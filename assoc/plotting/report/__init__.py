"""Reports: one HTML file that works without a network, to look at and to send on."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from assoc.plotting.report.association import write_association_report
    from assoc.plotting.report.sweep import write_sweep_report
    from assoc.plotting.report.tracking import write_tracking_report

_HOME = {
    "write_association_report": "association",
    "write_sweep_report": "sweep",
    "write_tracking_report": "tracking",
}

__all__ = ["write_association_report", "write_sweep_report", "write_tracking_report"]


def __getattr__(name: str) -> Any:
    """Load a public name from its home on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'assoc.plotting.report' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"assoc.plotting.report.{_HOME[name]}"), name)
    globals()[name] = value
    return value
