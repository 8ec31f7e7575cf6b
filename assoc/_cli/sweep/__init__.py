"""What `assoc.sweep` alone needs: its options, and the tables of a study."""
