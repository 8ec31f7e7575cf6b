"""Measurements as they come in: late ones put in their place, and the picture of the moment."""
