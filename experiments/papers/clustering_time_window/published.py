"""Tables 4.25 to 4.27 of the paper, in percent.

G. P. Cahyono, Multitarget tracking using multiple hypothesis tracking with clustering time window radar data, thesis,
ITS Surabaya (2014).
"""

import numpy as np

from assoc._types import Array

RATES = ("CT", "MT", "IT")

WITHOUT_WINDOW = np.array(
    [
        (42.6, 51.19, 3.33),
        (60.47, 56.93, 15.6),
        (71.72, 62.24, 23.33),
        (60.48, 52.59, 30.44),
        (62.79, 49.33, 26.81),
        (60.04, 48.63, 21.91),
        (53.41, 36.43, 41.72),
        (53.09, 24.67, 50.39),
        (52.13, 36.95, 60.42),
        (48.95, 12.96, 60.57),
        (52.11, 16.76, 68.69),
        (52.3, 5.67, 64.84),
        (48.12, 21.48, 56.36),
        (40.02, 12.57, 56.99),
        (38.89, 17.59, 58.54),
        (44.24, 3.33, 85.24),
        (40.67, 12.51, 65.28),
        (44.96, 13.33, 50.59),
    ]
)
"""Table 4.25: CT, MT, IT of ten groups each, without window (183 groups)."""

WITH_WINDOW = np.array(
    [
        (70.3, 76.51, 9.31),
        (96.88, 88.34, 18.23),
        (88.89, 87.56, 25.24),
        (94.88, 81.72, 28.75),
        (93.81, 74.62, 32.63),
        (81.73, 74.48, 17.68),
        (78.44, 83.88, 18.54),
        (83.66, 75.91, 18.41),
        (89.13, 74.55, 37.31),
        (88.71, 82.47, 16.55),
        (91.28, 86.13, 19.07),
        (94.15, 79.83, 42.13),
    ]
)
"""Table 4.26: the same with the clustering time window (119 windows)."""

OVERALL = {"without": (51.49, 29.73, 46.73), "with": (87.66, 80.5, 23.65)}
"""Table 4.27."""


def by_tens(per_window: Array, length: int) -> Array:
    """Means of ten windows each, (length, 3), of rates (K, 3), NaN where a window has none; the last takes the rest."""
    tens = np.minimum(np.arange(len(per_window)) // 10, length - 1)
    means = np.full((length, 3), np.nan)
    for k in np.unique(tens):
        means[k] = np.nanmean(per_window[tens == k], axis=0)
    return means
