"""ASTERIX (extra ``[asterix]``): read plots and ADS-B reports as recordings, write plots and tracks.

The package ``libasterix`` decodes and encodes items.
"""

from __future__ import annotations

from assoc.integrations.asterix.reading import AsterixContent, RadarNote, read_asterix
from assoc.integrations.asterix.table import read_records
from assoc.integrations.asterix.tracks import read_tracks, write_tracks
from assoc.integrations.asterix.writing import write_plots

__all__ = ["AsterixContent", "RadarNote", "read_asterix", "read_records", "read_tracks", "write_plots", "write_tracks"]
