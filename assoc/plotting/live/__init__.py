"""A page on loopback that shows tracks live."""

from assoc.plotting.live.server import LivePage

__all__ = ["LivePage"]
