"""Measurements of the toolkit: benchmarks against other solvers, and the papers' tables and figures.

``python -m experiments`` lists the programs, ``python -m experiments.NAME --help`` tells the options of each.
"""
