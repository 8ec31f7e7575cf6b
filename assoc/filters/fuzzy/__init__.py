"""The extended Kalman filter whose noise is set by fuzzy rules."""
