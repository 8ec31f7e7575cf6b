"""Plain text and HTML for output."""
