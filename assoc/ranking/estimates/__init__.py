"""Estimates of the probability of each tuple where intervals stay wide: a truncated sweep, or chains of samples."""
