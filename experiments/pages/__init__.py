"""The tables of the pages, made from the published results."""
