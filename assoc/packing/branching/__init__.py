"""Branch and bound on a packing."""
