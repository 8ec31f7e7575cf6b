"""Proven optima: reduction, dual bound, branch and bound."""
