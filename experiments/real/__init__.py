"""Experiments on real recordings, given by their path."""
