"""Trackers that decide each scan by itself."""
