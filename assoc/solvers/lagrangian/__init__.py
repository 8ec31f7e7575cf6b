"""Successive Lagrangian relaxation down to two dimensions."""
