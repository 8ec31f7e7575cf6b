"""Lower bounds of a packing, from multipliers of its rows."""
