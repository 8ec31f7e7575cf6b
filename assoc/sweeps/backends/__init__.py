"""Backends that compute the runs of a study: processes or a cluster."""
