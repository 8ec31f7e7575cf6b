"""How the work grows: scenes and trackers, size by size."""
