"""Faults put in on purpose: `make mutants` shows that a test of the right room notices each."""
