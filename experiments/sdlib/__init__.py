"""A set of S-D assignment problems with proven optima: instances, a verifier, a table, a runner for any solver."""
