"""ASTERIX (extra ``[asterix]``): plots and ADS-B reports read as recordings, plots and tracks written.

Decoding and encoding of items is that of the package ``libasterix``.
"""

from __future__ import annotations

from assoc.integrations.asterix.reading import AsterixContent, RadarNote, read_asterix
from assoc.integrations.asterix.tracks import read_tracks, write_tracks
from assoc.integrations.asterix.writing import write_plots

__all__ = ["AsterixContent", "RadarNote", "read_asterix", "read_tracks", "write_plots", "write_tracks"]
