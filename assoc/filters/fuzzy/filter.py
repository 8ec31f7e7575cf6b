"""The EKF whose process and measurement noise fuzzy rules scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Expected, Filter, Update
from assoc.filters.batches import Batch
from assoc.filters.fuzzy.inference import FuzzyRules, FuzzyVariable
from assoc.filters.kalman import ExtendedKalmanFilter
from assoc.filters.measurement import Measurement
from assoc.filters.motion.models import Motion
from assoc.filters.state import Gaussian, gaussian


@dataclass(frozen=True, eq=False, repr=False)
class Adaptive(Batch):
    """Gaussians and the state of the adaptation: (B, n), (B, n, n)."""

    mean: Array
    covariance: Array
    without_noise: Array
    """Covariance of the last prediction before noise was added; after a correction the covariance itself."""
    process_noise: Array
    """Process noise of the last prediction, unscaled; 0 after a correction, (B or 1, n, n)."""
    innovations: Array
    """The last normalised innovations, newest last, (B, W, d); d is 0 before the first measurement."""
    turns: Array
    """The last corrections of the state's last component, each in units of its standard deviation, (B, W)."""
    process_scale: Array
    """What the process noise of each component is multiplied with, q, (B, n)."""

    @property
    def gaussian(self) -> Gaussian:
        """Means and covariances alone."""
        return gaussian(self.mean, self.covariance)


Watched = Literal["innovations", "turn", "turn rate"]


@dataclass(frozen=True)
class Alarm:
    """A quantity watched over a window of measurements, and the rules that it is the input of.

    Parameters
    ----------
    window : int
        W, measurements.
    process : sequence of FuzzyRules
        Infer q, one for each group of components.
    calm : FuzzyRules or None
        Infer the variance with which the last component of the state is believed to be 0.
    watches : "innovations", "turn" or "turn rate"
        The rules' input. "innovations": ``|sum of the last W innovations|^2`` / W in units of their standard
        deviations, averaged over the components. "turn": the same of what the innovations say of the last
        component of the state, a turn rate, K v / sqrt(K S K') with its row of the gain: only along the direction
        in which a turn moves the target. "turn rate": the squared estimate itself in units of its variance, of one
        measurement (W = 1): in a steady turn the innovations show nothing.
    """

    window: int
    process: Sequence[FuzzyRules]
    calm: FuzzyRules | None = None
    watches: Watched = "innovations"

    def __post_init__(self) -> None:
        if self.watches not in get_args(Watched):
            raise InvalidInputError(f"watches must be one of {', '.join(get_args(Watched))}, got {self.watches!r}")
        if self.watches == "turn rate" and self.window != 1:
            raise InvalidInputError(f"window must be 1 for a turn rate, got {self.window!r}")
        if isinstance(self.window, bool) or not isinstance(self.window, int) or self.window < 1:
            raise InvalidInputError(f"window must be a whole number of at least 1, got {self.window!r}")


class FuzzyAdaptiveEKF(Filter[Adaptive]):
    """An EKF with Q scaled by q and R by r, which fuzzy rules infer from the last innovations.

    The rules' input is ``|sum of the last W innovations|^2`` / W, each component in units of its standard
    deviation, averaged over the components: equation 36 of the paper for W = 1. Its mean is 1 when the
    filter is right; with W > 1 it grows only with innovations of one direction, as those of a manoeuvre, and
    not with large noise.

    Parameters
    ----------
    motion : Motion
    process : FuzzyRules, sequence of FuzzyRules, or None
        Infer q; None leaves it at 1. Several scale groups of components each.
    measurement : FuzzyRules or None
        Infers r; None leaves it at 1.
    window : int
        W.
    logarithmic : bool
        Whether the rules' outputs are the logarithms (base 10) of q and r.
    components : sequence of int, optional
        Components of the innovation that are averaged; all if left out. A turn in the horizontal plane
        leaves the elevation as it is.
    groups : sequence of int, optional
        For each component of the state the number of its rules in `process`; all 0 if left out. Q becomes
        D Q D with the roots of the scales in D.
    immediate : bool
        Whether q already scales the noise of the prediction that the measurement corrects; otherwise, as in
        the paper, that of the next.
    calm : FuzzyRules or None
        Infer the variance with which the last component of the state, a turn rate, is believed to be 0: it is
        corrected with a measurement of 0 of that variance, so that in straight flight one model forgets its turns.
    others : sequence of Alarm
        More windows, with their own rules; the largest inferred value counts. A short window shows a hard manoeuvre
        at once, only a long one a gentle manoeuvre.

    References
    ----------
    Wiranto, Ridwan and Kadir, hybrid of the extended Kalman filter and fuzzy inference, equations 32 to 36.
    """

    def __init__(
        self,
        motion: Motion,
        process: FuzzyRules | Sequence[FuzzyRules] | None,
        measurement: FuzzyRules | None = None,
        *,
        window: int = 1,
        logarithmic: bool = False,
        components: Sequence[int] | None = None,
        groups: Sequence[int] | None = None,
        immediate: bool = False,
        calm: FuzzyRules | None = None,
        others: Sequence[Alarm] = (),
    ) -> None:
        super().__init__(motion)
        several = (process,) if isinstance(process, FuzzyRules) else tuple(process or ())
        self.alarms = (Alarm(window, several, calm), *others)
        if any(len(other.process) != len(several) or (other.calm is None) != (calm is None) for other in others):
            raise InvalidInputError(f"others: each must have {len(several)} rules, and calm where the first has")
        named = [("process", rules) for alarm in self.alarms for rules in alarm.process]
        for name, rules in (*named, *(("calm", alarm.calm) for alarm in self.alarms), ("measurement", measurement)):
            if rules is not None and not logarithmic and rules.output.corners[:, 0].min() < 0:
                raise InvalidInputError(f"{name}: a scale must not be negative")
        self.groups = np.zeros(motion.dim, np.int64) if groups is None else np.array(groups, np.int64)
        known = max(len(several), 1)
        if self.groups.shape != (motion.dim,) or (self.groups < 0).any() or (self.groups >= known).any():
            raise InvalidInputError(f"groups must be {motion.dim} numbers from 0 to {known - 1}")
        self.process, self.measurement = several, measurement
        self.components = None if components is None else tuple(components)
        self.logarithmic, self.immediate = logarithmic, immediate
        self.window = max(alarm.window for alarm in self.alarms)
        self._ekf, self._bare = ExtendedKalmanFilter(motion), ExtendedKalmanFilter(_NoiseFree(motion))

    @classmethod
    def from_data(cls, motion: Motion, data: Mapping[str, Any]) -> FuzzyAdaptiveEKF:
        """Make a filter of parameters kept as data: window, immediate, input and output centres (log10 q).

        Parameters
        ----------
        motion : Motion
        data : mapping
            "inputs" (increasing centres), "outputs" (their log10 q, or a list of those for each group),
            "groups" if there are several, "components" if not all count, "window", "immediate"; "calm", log10
            variances; "others", a list of more "window", "inputs" and what each "watches".
        """
        outputs = data["outputs"] if isinstance(data["outputs"][0], list) else [data["outputs"]]
        alarms = []
        for window in (data, *data.get("others", ())):
            inputs = window["inputs"]
            levels = [f"level {i}" for i in range(1, len(inputs) + 1)]
            sets = FuzzyVariable.from_centres(levels, inputs, 1.0)
            rules = [
                FuzzyRules(
                    sets,
                    FuzzyVariable.from_centres(levels, centres, float(data.get("reach", 0.05))),
                    [(level, level) for level in levels],
                    points=int(data.get("points", 101)),
                )
                for centres in (*outputs, *([data["calm"]] if "calm" in data else []))
            ]
            calm = rules.pop() if "calm" in data else None
            alarms.append(Alarm(int(window["window"]), rules, calm, window.get("watches", "innovations")))
        return cls(
            motion,
            alarms[0].process,
            window=alarms[0].window,
            logarithmic=True,
            components=data.get("components"),
            groups=data.get("groups"),
            immediate=bool(data["immediate"]),
            calm=alarms[0].calm,
            others=alarms[1:],
        )

    def start(self, state: Gaussian) -> Adaptive:
        """Begin with q = 1 and no innovations."""
        state = self._ekf.start(state)
        B = len(state)
        # innovations of up to three components and turns, those of the last step and those of this one
        memory.require(
            8.0 * 2 * 4 * B * self.window, f"window = {self.window}: innovations of {B} targets", "shorten the window"
        )
        return Adaptive(
            state.mean, state.covariance, state.covariance, np.zeros((1, *state.covariance.shape[1:])),
            np.zeros((B, self.window, 0)), np.zeros((B, self.window)), np.ones((B, self.motion.dim)),
        )  # fmt: skip

    def predict(self, state: Adaptive, dt: float) -> Adaptive:
        """Return the state dt seconds later; see `Filter.predict`."""
        moved = self._bare.predict(state.gaussian, dt)
        Q = self.motion.noise(state.mean, dt)
        scaled = _scaled(state.process_scale, Q)
        return Adaptive(
            moved.mean, moved.covariance + scaled, moved.covariance, Q, state.innovations, state.turns,
            state.process_scale,
        )  # fmt: skip

    def move(self, state: Adaptive, dt: float) -> tuple[Adaptive, Array]:
        """`predict`, and the covariance P F' of the states before and after it."""
        F = self.motion.jacobian(state.mean, dt)
        return self.predict(state, dt), state.covariance @ F.transpose(0, 2, 1)

    def update(self, state: Adaptive, measured: Array, sensor: Measurement) -> Update[Adaptive]:
        """Infer q and r, then correct each target with its measurement; see `Filter.update`."""
        o = self._ekf.observe(sensor)
        if self.components is not None and max(self.components, default=0) >= o.dim:
            raise InvalidInputError(f"components must be below {o.dim} for this sensor, got {self.components}")
        first = self._ekf.correct(state.gaussian, measured, o)
        variances = np.einsum("bii->bi", first.covariance)
        fresh = first.innovation / np.sqrt(variances)
        past = state.innovations
        if past.shape[2] != o.dim:
            # the first measurement, or a sensor with other components
            past = np.zeros((len(fresh), self.window, o.dim))
        recent = np.concatenate([past[:, 1:], fresh[:, None]], axis=1)
        turns = np.concatenate([state.turns[:, 1:], _turn(state, first.state)[:, None]], axis=1)
        level, q, calm = self._infer(recent, turns, first.state)
        r = self._scale(self.measurement, level)
        prior = state.covariance
        if self.immediate:
            prior = state.without_noise + _scaled(q, state.process_noise)
        done = first
        if self.immediate or self.measurement is not None:
            done = self._ekf.correct(gaussian(state.mean, prior), measured, o, r)
        mean, covariance = done.state.mean, done.state.covariance
        if calm is not None:
            mean, covariance = _calmed(mean, covariance, calm)
        # a second measurement of the same time: no process noise lies between them
        still = np.zeros((1, *covariance.shape[1:]))
        corrected = Adaptive(mean, covariance, covariance, still, recent, turns, q)
        return Update(corrected, done.innovation, done.covariance, done.nis, done.log_likelihood)

    def prior(self, predicted: Adaptive, corrected: Adaptive) -> tuple[Array, Array]:
        """Mean and covariance of the prediction as it was corrected, after the adaptation."""
        if not self.immediate:
            return predicted.mean, predicted.covariance
        return predicted.mean, predicted.without_noise + _scaled(corrected.process_scale, predicted.process_noise)

    def _infer(self, recent: Array, turns: Array, present: Gaussian) -> tuple[Array, Array, Array | None]:
        """Input of the first rules (B,), q (B, n), and the variance of a turn rate of 0, (B,)."""
        q = calm = first = None
        for alarm in self.alarms:
            level = self._level(alarm, recent, turns, present)
            scale = np.ones((len(level), self.motion.dim))
            for group, rules in enumerate(alarm.process):
                scale[:, self.groups == group] = self._scale(rules, level)[:, None]
            q = scale if q is None else np.maximum(q, scale)
            first = level if first is None else first
            if alarm.calm is not None:
                variance = self._scale(alarm.calm, level)
                calm = variance if calm is None else np.maximum(calm, variance)
        assert q is not None and first is not None
        return first, q, calm

    def _level(self, alarm: Alarm, recent: Array, turns: Array, present: Gaussian) -> Array:
        """Return what an alarm watches, (B,)."""
        if alarm.watches == "turn rate":
            return present.mean[:, -1] ** 2 / present.covariance[:, -1, -1]
        late = recent[:, -alarm.window :]
        known = np.maximum((late != 0).any(axis=2).sum(axis=1), 1)
        if alarm.watches == "turn":
            return turns[:, -alarm.window :].sum(axis=1) ** 2 / known
        drift = late.sum(axis=1)
        if self.components is not None:
            drift = drift[:, self.components]
        return (drift**2).mean(axis=1) / known

    def _scale(self, rules: FuzzyRules | None, level: Array) -> Array:
        if rules is None:
            return np.ones(len(level))
        scale = rules(level)
        return np.power(10.0, scale) if self.logarithmic else scale

    def expected(self, state: Adaptive, sensor: Measurement) -> Expected:
        """Return the expected measurements and covariances at the present q; see `Filter.expected`."""
        return self._ekf.expected(state.gaussian, sensor)


def _scaled(q: Array, Q: Array) -> Array:
    """Process noise with each component's variance multiplied by its q (B, n)."""
    root = np.sqrt(q)
    return root[:, :, None] * Q * root[:, None, :]


def _calmed(mean: Array, P: Array, variance: Array) -> tuple[Array, Array]:
    """Correct with a measurement of 0 of the last component, (B,) variances; Joseph's form."""
    gain = P[:, :, -1] / (P[:, -1, -1] + variance)[:, None]
    # (I - K h') P (I - K h')' with h' the last unit vector: two steps of rank one
    P = P - gain[:, :, None] * P[:, -1:, :]
    P = P - P[:, :, -1:] * gain[:, None, :] + variance[:, None, None] * gain[:, :, None] * gain[:, None, :]
    return mean - gain * mean[:, -1:], 0.5 * (P + P.transpose(0, 2, 1))


def _turn(before: Adaptive, after: Gaussian) -> Array:
    """Correction of the last component in units of its standard deviation, (B,); 0 where it was not corrected."""
    # K S K' is what a correction takes from the variance
    gained = before.covariance[:, -1, -1] - after.covariance[:, -1, -1]
    corrected = gained > 1e-12 * before.covariance[:, -1, -1]
    change = after.mean[:, -1] - before.mean[:, -1]
    return np.where(corrected, change / np.sqrt(np.where(corrected, gained, 1.0)), 0.0)


class _NoiseFree(Motion):
    """A motion model with its process noise taken away."""

    def __init__(self, motion: Motion) -> None:
        self.dim, self.position, self.inner = motion.dim, motion.position, motion
        self._zero = np.zeros((1, motion.dim, motion.dim))

    @property
    def linear(self) -> bool:
        return self.inner.linear

    def propagate(self, states: Array, dt: float) -> Array:
        return self.inner.propagate(states, dt)

    def jacobian(self, states: Array, dt: float) -> Array:
        return self.inner.jacobian(states, dt)

    def noise(self, states: Array, dt: float) -> Array:
        return self._zero
