"""Filters, one a file, and motion models; see docs/filters.md."""

from __future__ import annotations

from assoc._system.imports import lazy_names
from assoc.filters.base import Expected, Filter, History, Update
from assoc.filters.consistency import bounds, nees
from assoc.filters.ensemble import Ensemble, EnsembleKalmanFilter
from assoc.filters.fuzzy.filter import Alarm, FuzzyAdaptiveEKF
from assoc.filters.fuzzy.inference import FuzzyRules, FuzzyVariable
from assoc.filters.fuzzy.rules import paper_rules, tuned_data
from assoc.filters.imm import InteractingMultipleModel, Mixture, transition_from_sojourns
from assoc.filters.kalman import ExtendedKalmanFilter, KalmanFilter
from assoc.filters.measurement import FunctionMeasurement, LinearMeasurement, Measurement
from assoc.filters.modified_ekf import ModifiedEKF
from assoc.filters.motion.correlated import Jerk, Singer
from assoc.filters.motion.free_flight import FreeFlight
from assoc.filters.motion.models import (
    ConstantAcceleration,
    ConstantVelocity,
    CoordinatedTurn,
    LinearMotion,
    Motion,
    Padded,
)
from assoc.filters.motion.unit_rates import UnitRates
from assoc.filters.motion.unmanned_aircraft import Aerodynamics, UnmannedAircraft
from assoc.filters.smoother import FixedLagSmoother, Window
from assoc.filters.state import Gaussian
from assoc.filters.unscented import UnscentedKalmanFilter

__all__ = [
    "Aerodynamics",
    "Alarm",
    "ConstantAcceleration",
    "ConstantVelocity",
    "CoordinatedTurn",
    "Ensemble",
    "EnsembleKalmanFilter",
    "Expected",
    "ExtendedKalmanFilter",
    "Filter",
    "FixedLagSmoother",
    "FunctionMeasurement",
    "FuzzyAdaptiveEKF",
    "FuzzyRules",
    "FuzzyVariable",
    "Gaussian",
    "History",
    "InteractingMultipleModel",
    "Jerk",
    "KalmanFilter",
    "LinearMeasurement",
    "LinearMotion",
    "Measurement",
    "Mixture",
    "ModifiedEKF",
    "Motion",
    "Padded",
    "Singer",
    "FreeFlight",
    "UnitRates",
    "UnmannedAircraft",
    "UnscentedKalmanFilter",
    "Update",
    "Window",
    "bounds",
    "nees",
    "paper_rules",
    "transition_from_sojourns",
    "tuned_data",
]

__getattr__, __dir__ = lazy_names(__name__, {})
