"""Adapters to other people's frameworks, one a file or folder; each asks for its extra when it is imported."""

from assoc._system.imports import lazy_names

__getattr__, __dir__ = lazy_names(__name__, {})
