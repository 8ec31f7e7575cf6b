"""What all tests share."""

from __future__ import annotations

from hypothesis import settings

# the first example pays for compilation, and machines differ: a deadline would only find that out
settings.register_profile("assoc", deadline=None)
settings.load_profile("assoc")
