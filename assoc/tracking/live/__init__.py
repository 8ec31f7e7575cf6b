"""Live tracking: measurements as they arrive, late ones included, and the current picture."""
