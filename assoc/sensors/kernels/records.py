"""Types of the compiled sensor models."""

from __future__ import annotations

import math

TURN = 2.0 * math.pi

Three = tuple[float, float, float]
"""x, y, z in metres, or the components of a measurement, padded with zeros."""

Six = tuple[float, float, float, float, float, float]
"""A symmetric 3 x 3 matrix: (xx, xy, xz, yy, yz, zz)."""

Converted = tuple[Three, Six]
"""The position that a measurement points at, and its covariance."""

Information = tuple[float, float, float, float, float, float, float, float, float, float]
"""Chi-square, its gradient H' R^-1 nu (x, y, z) and H' R^-1 H (xx, xy, xz, yy, yz, zz)."""
