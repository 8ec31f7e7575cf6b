"""The linear program of a packing, by a dual simplex method of our own."""
