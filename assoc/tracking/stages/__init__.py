"""Stages of a step and what they need: checks, coverage, lives of tracks, identities, lost tracks taken up."""
