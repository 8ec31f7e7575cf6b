"""Compiled tools that know no packing: matching, sorting, a heap."""
