"""Families of assignment problems, each a plain function of a seed."""
