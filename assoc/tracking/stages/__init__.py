"""Stages of a step and what they need: checks, looks, lives of tracks, identities, lost tracks taken up."""
