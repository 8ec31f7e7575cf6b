"""The ant colony paper: Table 1, why its cycles are not met, and its conclusion against the truth."""
