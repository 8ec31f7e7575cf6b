"""Dubins paths and the ensemble Kalman filter for an unmanned aircraft."""
