"""Reports: one HTML file that works without a network, to look at and to send on."""

from __future__ import annotations

from assoc.plotting.report.association import write_association_report
from assoc.plotting.report.page import check_report

__all__ = ["check_report", "write_association_report"]
