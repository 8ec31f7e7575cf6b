"""The ant colony: the max-min colony and the paper's rule."""
