"""The k best solutions, and the probability of each tuple."""
