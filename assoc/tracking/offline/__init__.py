"""Whole recordings: windows of plots to tracks, slices of time tracked apart and stitched, smoothing."""
