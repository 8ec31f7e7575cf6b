"""Multiple hypothesis tracking, track-oriented and hypothesis-oriented."""
