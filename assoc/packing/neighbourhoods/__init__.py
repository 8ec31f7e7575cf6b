"""Ways to improve a cover; each is one file."""
