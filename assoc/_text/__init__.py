"""Text for people: plain and HTML."""
