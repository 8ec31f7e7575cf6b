"""Adapters to other people's frameworks, one a file or folder; each asks for its extra when it is imported."""
