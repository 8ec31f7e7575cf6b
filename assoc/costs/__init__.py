"""Likelihood-ratio costs: from the measurements of a scan to a sparse assignment problem."""

from __future__ import annotations

from assoc.costs.build import build_problem, emission_times, positions_and_covariances, tuple_costs

__all__ = ["build_problem", "emission_times", "positions_and_covariances", "tuple_costs"]
