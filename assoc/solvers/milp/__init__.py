"""The integer program, solved with OR-Tools."""
