"""Compiled general-purpose tools: matching, auction, a heap."""
