"""Compiled models of the sensors, one file a kind and `dispatch` over them; sensors can be used without numba."""
