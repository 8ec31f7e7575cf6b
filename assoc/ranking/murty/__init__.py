"""Murty's ranking of two-dimensional assignments."""
