"""Tracks for other programs: maps. For tables see `assoc.tracking.TrackTable`, for ASTERIX `assoc.integrations`."""
