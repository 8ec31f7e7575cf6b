"""Registration: biases of sensors, from the targets that they see in common; see docs/registration.md."""

from __future__ import annotations

from assoc._system.imports import lazy_names
from assoc.registration.correction import with_biases
from assoc.registration.parameters import COMPONENTS, RegistrationParameters
from assoc.registration.register import register
from assoc.registration.result import Registration
from assoc.registration.terms import Term

__all__ = [
    "COMPONENTS",
    "Registration",
    "RegistrationParameters",
    "Term",
    "register",
    "with_biases",
]

__getattr__, __dir__ = lazy_names(__name__, {})
