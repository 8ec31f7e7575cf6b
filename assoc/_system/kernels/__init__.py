"""Kernels that several rooms call."""
