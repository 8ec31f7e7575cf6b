"""The cheapest tuple that still fits, again and again."""
