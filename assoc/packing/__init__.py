"""The solvers' model: a weighted set packing, its bounds, and the searches on it."""
