"""Residuals of measurements before and after registration."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.plotting.axes import axes_or_new, legend
from assoc.plotting.colours import BLACK, BLUE, ORANGE
from assoc.registration import Registration
from assoc.registration.terms import label_of
from assoc.sensors.base import ANGLES


def residual_columns(registration: Registration, component: str) -> list[tuple[int, int]]:
    """Sensors that measure a component, and its index among theirs."""
    return [
        (s, sensor.components.index(component))
        for s, sensor in enumerate(registration.sensors)
        if component in sensor.components[: sensor.position_part.dim]
    ]


@explains_wrong_types
def plot_residuals(registration: Registration, component: str = "range", *, ax: Any = None) -> Any:
    """Draw the residuals of a component before and after registration, one pair of boxes for each sensor.

    A box holds the middle half of the residuals, its line is the median, the whiskers hold 95 %; the black lines are
    1.96 standard deviations of the sensor's noise.

    Parameters
    ----------
    registration : Registration
    component : str
        range, azimuth, elevation, x, y or z.
    ax : matplotlib Axes, optional
        Where to draw; new ones without it.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInputError
        No sensor measures the component.
    """
    columns = residual_columns(registration, component)
    if not columns:
        raise InvalidInputError(f"component: no sensor measures {component!r}")
    ax = axes_or_new(ax, (7.0, 3.5))
    scale, unit = (float(np.degrees(1.0)), "deg") if component in ANGLES else (1.0, "m")
    for number, (s, i) in enumerate(columns):
        residuals = registration.residuals[s]
        for offset, values, colour in ((-0.18, residuals.before, ORANGE), (0.18, residuals.after, BLUE)):
            if len(values):
                box = ax.boxplot(
                    scale * values[:, i], positions=[number + offset], widths=0.3, whis=(2.5, 97.5), showfliers=False,
                    patch_artist=True, manage_ticks=False,
                )  # fmt: skip
                box["boxes"][0].set(facecolor=colour, alpha=0.8)
                box["medians"][0].set(color=BLACK)
        limit = 1.96 * scale * float(np.sqrt(registration.sensors[s].covariance[i, i]))
        ax.hlines([-limit, limit], number - 0.4, number + 0.4, color=BLACK, linewidth=1.0, linestyle="--")
    for label, colour in (("before", ORANGE), ("after", BLUE)):
        ax.plot([], [], "s", color=colour, label=label)
    ax.plot([], [], "--", color=BLACK, label="noise of the sensor, 95 %")
    ax.set_xticks(range(len(columns)), [label_of(registration.sensors, s) for s, _ in columns])
    ax.set_ylabel(f"residual of {component} ({unit})")
    ax.grid(alpha=0.25, linewidth=0.6, axis="y")
    legend(ax)
    return ax
