"""Dubins paths, and the way around obstacles."""
