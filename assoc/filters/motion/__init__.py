"""How targets move."""
