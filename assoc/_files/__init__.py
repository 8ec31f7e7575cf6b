"""Files: read without trust, written completely or not at all."""
