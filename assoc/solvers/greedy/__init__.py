"""Greedy: the cheapest tuple that still fits, again and again."""
