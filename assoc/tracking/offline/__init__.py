"""Whole recordings: windows of plots to tracks, smoothing."""
