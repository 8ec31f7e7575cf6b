"""Kernels that several rooms call, and how code is made of kernels (lowering.py)."""
