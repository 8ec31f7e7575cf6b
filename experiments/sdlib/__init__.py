"""A set of S-D assignment problems with proven optima: instances, a table, a runner for any solver."""
