"""Parts of ``python -m assoc.track`` and ``assoc.live``: their options, and plots from a stream."""
