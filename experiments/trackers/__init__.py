"""Scenes and peers of the tracker experiments."""
