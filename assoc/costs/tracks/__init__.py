"""Candidate tuples of tracks and measurements, and their costs."""
