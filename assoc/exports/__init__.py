"""Tracks for other programs: maps of the earth. Tables are `assoc.tracking.TrackTable`, ASTERIX is an integration."""
