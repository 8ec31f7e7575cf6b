"""A page on loopback that shows tracks while they move."""

from assoc.plotting.live.server import LivePage

__all__ = ["LivePage"]
