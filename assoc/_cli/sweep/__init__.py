"""Parts of `assoc.sweep`: its options, and the tables of a study."""
