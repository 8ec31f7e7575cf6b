"""Families of assignment problems, each a plain function of a seed."""

FIRST_SEED = 1000
"""Seeds from here on are reported and were used for no tuning; 0 to 99 are for that."""
