"""Probabilities of the pairs of two lists, by sums over all joint events: exact, or with intervals that hold."""
