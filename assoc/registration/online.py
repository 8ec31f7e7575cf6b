"""Registration scan by scan, with biases that drift, for live trackers."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.registration.correction import biases_of_sensors, corrected_measurements
from assoc.registration.epochs import epoch_of
from assoc.registration.estimation import Estimate, estimate
from assoc.registration.pairing import Chosen, Epoch, choose_tuples, widened
from assoc.registration.parameters import RegistrationParameters
from assoc.registration.register import make_problem
from assoc.registration.result import is_significant
from assoc.registration.terms import Term
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene, checked_measurements
from assoc.sensors import Sensor

HOUR = 3600.0
PREFIX = "registration_"
_STATE = ("biases", "covariance", "information", "time", "scans", "kept_times", "kept_sizes", "kept_values")
_MOST_KEPT = 32
"""Scans that are kept at the beginning, and estimated together."""


@explains_wrong_types
class OnlineRegistration:
    """Biases that are estimated while measurements come in.

    At first scans are kept, and estimated together after 1, 2, 4, 8, 16 and 32 of them, as
    `assoc.registration.register` does. From then on, and between these, each scan is associated with the biases known
    so far and corrects them, as a Kalman filter whose state are the biases; memory does not grow. Biases drift as a
    random walk. Measurements are corrected only once a bias is significant.

    Parameters
    ----------
    sensors : sequence of Sensor
    region : array_like (3, 2), optional
        See `assoc.Scene`.
    parameters : RegistrationParameters, optional
        Clocks' biases cannot be found scan by scan and are refused; so are those of positions, which correct the
        sensors and not the measurements.
    """

    def __init__(
        self, sensors: Sequence[Sensor], region: Array | None = None, parameters: RegistrationParameters | None = None
    ) -> None:
        self.parameters = parameters or RegistrationParameters()
        for component in ("time", "position"):
            if component in self.parameters.components:
                raise InvalidInputError(f"components: {component!r} is not estimated online, register a recording")
        empty = [[np.zeros((0, sensor.dim)) for sensor in sensors if isinstance(sensor, Sensor)]]
        scene = Scene(sensors, np.zeros(1), empty, region)  # type: ignore[arg-type]
        if any(sensor.platform is not None for sensor in scene.sensors):
            raise InvalidInputError("registration: sensors on platforms are registered from scenes, not online")
        self._problem = make_problem(scene, self.parameters)
        n = len(self._problem.terms)
        nothing = Chosen(np.zeros(0, dtype=np.int64), np.zeros((0, len(scene.sensors)), dtype=np.int64))
        self._now = Estimate(np.zeros(n), np.diag(self._problem.spreads**2), np.zeros((n, n)), nothing)
        self._kept: tuple[Epoch, ...] = ()
        self._time: float | None = None
        self._scans = 0

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """As they were stated."""
        return self._problem.sensors

    @property
    def biases(self) -> Array:
        """Biases now, (n,), in the order of `terms`; metres and radians."""
        return self._now.biases

    @property
    def covariance(self) -> Array:
        """Their covariance, (n, n)."""
        return self._now.covariance

    @property
    def terms(self) -> tuple[Term, ...]:
        """Sensor and component of each bias."""
        return self._problem.terms

    @property
    def significant(self) -> bool:
        """Whether any bias is significant, see `Registration.significant`."""
        return is_significant(self.biases, self.covariance)

    def correct(self, measurements: Sequence[Array]) -> list[Array]:
        """Measurements without the biases known so far."""
        checked = checked_measurements(measurements, self.sensors, "measurements")
        if not self.significant:
            return list(measurements)
        by_sensor = biases_of_sensors(self.sensors, self.terms, self.biases)
        return [
            corrected_measurements(sensor, z, biases)
            for sensor, z, biases in zip(self.sensors, checked, by_sensor, strict=True)
        ]

    def after(self, time: float, measurements: Sequence[Array]) -> OnlineRegistration:
        """Return the registration after one more scan; this object stays unchanged.

        Parameters
        ----------
        time : float
            Seconds.
        measurements : sequence over sensors of arrays (n_s, d_s)
            As they came, with their biases.

        Raises
        ------
        InvalidInputError
            Measurements have the wrong shape, or are not finite.
        """
        later = copy.copy(self)
        epoch = epoch_of(Scan(self._scans, time, checked_measurements(measurements, self.sensors, "measurements")))
        apart = 0.0 if self._time is None else max(time - self._time, 0.0)
        drift = (self.parameters.drift * self._problem.spreads) ** 2 * apart / HOUR
        later._now = replace(self._now, covariance=self._now.covariance + np.diag(drift))
        later._time, later._scans = time, self._scans + 1
        if later._scans > _MOST_KEPT:
            later._now = later._corrected(epoch)
            return later
        kept = (*self._kept, epoch)
        # together after 1, 2, 4, 8 ... scans
        together = later._scans & (later._scans - 1) == 0
        later._now = estimate(self._problem, kept) if together else later._corrected(epoch)
        later._kept = () if later._scans == _MOST_KEPT else kept
        return later

    def _corrected(self, epoch: Epoch) -> Estimate:
        """The biases after one more scan: one step of a filter in information form."""
        now, problem = self._now, self._problem
        wide = widened(problem.scene([epoch], now.biases), problem.terms, np.sqrt(np.diagonal(now.covariance)))
        chosen = choose_tuples(wide, problem.parameters)
        if not len(chosen):
            return now
        sums = problem.equations([epoch], chosen, now.biases)
        covariance = np.linalg.inv(np.linalg.inv(now.covariance) + sums.information)
        covariance = 0.5 * (covariance + covariance.T)
        found = now.biases + covariance @ sums.gradient
        return Estimate(found, covariance, now.information + sums.information, chosen)

    def arrays(self) -> dict[str, Array]:
        """The state as arrays; `restored` reads it."""
        sizes = [[len(z) for z in epoch.measurements] for epoch in self._kept]
        values = [np.asarray(z).ravel() for epoch in self._kept for z in epoch.measurements]
        state = {
            "biases": self.biases,
            "covariance": self.covariance,
            "information": self._now.information,
            "time": np.array(math.nan if self._time is None else self._time),
            "scans": np.array(self._scans),
            "kept_times": np.array([epoch.time for epoch in self._kept]),
            "kept_sizes": np.array(sizes, dtype=np.int64).reshape(-1, len(self._problem.sensors)),
            "kept_values": np.concatenate([np.zeros(0), *values]),
        }
        return {f"{PREFIX}{name}": value for name, value in state.items()}

    def restored(self, arrays: Mapping[str, Array]) -> OnlineRegistration:
        """Take over a state that `arrays` has given.

        Raises
        ------
        InvalidInputError
            The arrays are of no such state.
        """
        state = {name: arrays[f"{PREFIX}{name}"] for name in _STATE}
        n, sensors = len(self._problem.terms), self._problem.sensors
        shapes = {"biases": (n,), "covariance": (n, n), "information": (n, n), "time": (), "scans": ()}
        shapes["kept_sizes"] = (len(state["kept_times"]), len(sensors))
        for name, shape in shapes.items():
            if state[name].shape != shape:
                raise InvalidInputError(f"the field '{PREFIX}{name}' has shape {state[name].shape}, expected {shape}")
        dims, covariance = np.array([sensor.dim for sensor in sensors]), state["covariance"]
        numbers = [state[name] for name in ("biases", "covariance", "information", "kept_times", "kept_values")]
        sizes, scans = state["kept_sizes"], int(state["scans"])
        good = all(np.isfinite(value).all() for value in numbers) and not math.isinf(float(state["time"]))
        good &= bool((sizes >= 0).all()) and int((sizes.astype(object) * dims).sum()) == state["kept_values"].size
        good &= len(sizes) == (scans if scans < _MOST_KEPT else 0) and scans >= 0
        good = good and bool((np.linalg.eigvalsh(0.5 * (covariance + covariance.T)) > 0).all())
        if not good:
            raise InvalidInputError(f"the fields '{PREFIX}...' are not the state of a registration")
        later = copy.copy(self)
        later._now = replace(self._now, biases=state["biases"], covariance=covariance, information=state["information"])
        later._time = None if math.isnan(float(state["time"])) else float(state["time"])
        later._scans = scans
        blocks = np.split(state["kept_values"], np.cumsum((sizes * dims).ravel())[:-1]) if sizes.size else []
        each = len(sensors)
        later._kept = tuple(
            epoch_of(Scan(k, time, tuple(blocks[k * each + s].reshape(-1, dims[s]) for s in range(each))))
            for k, time in enumerate(state["kept_times"].tolist())
        )
        return later
