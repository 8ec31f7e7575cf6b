"""How the work grows: scenes, trackers, recordings and large components, size by size."""
