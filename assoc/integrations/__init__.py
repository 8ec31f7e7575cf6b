"""Adapters to other people's frameworks, one a folder; each asks for its extra when it is imported."""
