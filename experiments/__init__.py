"""Measurements of the toolkit: benchmarks against other solvers, and the papers' tables and figures."""
