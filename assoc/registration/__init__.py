"""Registration: biases of sensors, from the targets that they see in common; see docs/registration.md."""

from __future__ import annotations

from assoc.registration.correction import with_biases
from assoc.registration.online import OnlineRegistration
from assoc.registration.parameters import COMPONENTS, RegistrationParameters
from assoc.registration.register import register
from assoc.registration.result import Registration
from assoc.registration.terms import Term

__all__ = [
    "COMPONENTS",
    "OnlineRegistration",
    "Registration",
    "RegistrationParameters",
    "Term",
    "register",
    "with_biases",
]
