"""Reports: one HTML file that works without a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._system.imports import lazy_names

if TYPE_CHECKING:
    from assoc.plotting.report.association import write_association_report
    from assoc.plotting.report.registration import write_registration_report
    from assoc.plotting.report.sweep import write_sweep_report
    from assoc.plotting.report.tracking import write_tracking_report

__all__ = ["write_association_report", "write_registration_report", "write_sweep_report", "write_tracking_report"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "association": "write_association_report",
        "registration": "write_registration_report",
        "sweep": "write_sweep_report",
        "tracking": "write_tracking_report",
    },
)
