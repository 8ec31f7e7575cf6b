"""The independent components of a packing, searched separately."""
