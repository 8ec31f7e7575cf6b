"""How a scan is associated with tracks: one file for each tracker."""
