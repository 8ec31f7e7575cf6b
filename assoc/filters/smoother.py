"""The fixed-lag smoother, for any filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter, S, Update
from assoc.filters.measurement import Measurement
from assoc.filters.state import Gaussian, gaussian


@dataclass(frozen=True, eq=False, repr=False)
class _Step:
    """One step of the past and the prediction that followed."""

    mean: Array
    covariance: Array
    gain: Array
    """Of the step that follows: cross covariance times the inverse of the prior, (B, n, n)."""
    next_mean: Array
    next_covariance: Array


@dataclass(frozen=True, eq=False, repr=False)
class Window(Generic[S]):
    """The present state of a filter and the steps that are still being smoothed."""

    state: S
    past: tuple[_Step, ...] = ()
    crossing: Array | None = None
    """Covariance between the state before the last prediction and after it; None once it is corrected."""
    before: S | None = None
    """The state before the last prediction."""

    def __len__(self) -> int:
        return len(self.state)

    def smoothed(self) -> list[Gaussian]:
        """Return the smoothed Gaussians from the oldest step to the present; at most lag + 1."""
        mean, covariance = self.state.mean, self.state.covariance
        result = [gaussian(mean, covariance)]
        for step in reversed(self.past):
            # Rauch, Tung and Striebel
            change = (step.gain @ (mean - step.next_mean)[..., None])[..., 0]
            spread = step.gain @ (covariance - step.next_covariance) @ step.gain.transpose(0, 2, 1)
            mean, covariance = step.mean + change, step.covariance + 0.5 * (spread + spread.transpose(0, 2, 1))
            result.append(gaussian(mean, covariance))
        return result[::-1]


class FixedLagSmoother(Generic[S]):
    """Smooths the last `lag` steps of any filter.

    The backward recursion of Rauch, Tung and Striebel over the window. Filters that carry more than a
    Gaussian (mixtures, ensembles) are smoothed by their means, covariances and cross covariances; an ensemble
    needs more members than the state has components.

    Parameters
    ----------
    filter : Filter
    lag : int
        Steps.
    """

    def __init__(self, filter: Filter[S], lag: int) -> None:
        if isinstance(lag, bool) or not isinstance(lag, int) or lag < 1:
            raise InvalidInputError(f"lag must be a whole number of at least 1, got {lag!r}")
        self.filter, self.lag = filter, lag

    def start(self, state: Gaussian) -> Window[S]:
        """Begin with a Gaussian and no past."""
        return Window(self.filter.start(state))

    def predict(self, window: Window[S], dt: float) -> Window[S]:
        """Return the window dt seconds later."""
        window = self._close(window, window.state)
        after, crossing = self.filter.move(window.state, dt)
        return Window(after, window.past, crossing, window.state)

    def update(self, window: Window[S], measured: Array, sensor: Measurement) -> tuple[Window[S], Update[S]]:
        """Correct the present; the past follows in `Window.smoothed`."""
        done = self.filter.update(window.state, measured, sensor)
        closed = self._close(window, done.state)
        return Window(done.state, closed.past), done

    def _close(self, window: Window[S], corrected: S) -> Window[S]:
        """Turn the last prediction into a step of the past."""
        if window.crossing is None or window.before is None:
            return window
        if corrected is window.state:
            mean, covariance = window.state.mean, window.state.covariance
        else:
            mean, covariance = self.filter.prior(window.state, corrected)
        try:
            gain = np.linalg.solve(covariance, window.crossing.transpose(0, 2, 1)).transpose(0, 2, 1)
        except np.linalg.LinAlgError as error:
            raise InvalidInputError("state: a predicted covariance is singular and cannot be smoothed") from error
        step = _Step(window.before.mean, window.before.covariance, gain, mean, covariance)
        return Window(window.state, (*window.past, step)[-self.lag :])
