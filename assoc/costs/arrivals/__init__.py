"""Tuples of arrival times, whose time of emission is not known: positions, costs, candidates."""
