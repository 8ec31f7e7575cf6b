"""Compiled general-purpose tools: matching, sorting, a heap."""
