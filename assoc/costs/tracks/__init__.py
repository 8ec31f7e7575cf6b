"""Candidate tuples of tracks and measurements, and what they cost."""
