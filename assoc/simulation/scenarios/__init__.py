"""Named scenarios, one a file; ``simulate`` runs one."""

from __future__ import annotations

from dataclasses import MISSING, fields
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from assoc._parameters import Parameters, whole_seed
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene

if TYPE_CHECKING:
    from assoc.simulation.scenarios.rotating_radar import SimulatedPlots

# scenario ``some-name`` is the file some_name.py, with a class ``SomeNameParameters`` and a function ``simulate``
_SCENES = ("three-radar", "crowd", "bearing-only", "dubins-uav", "rotating-radars", "arrival-times", "from-tracks")
# the same for those that make a recording of plots, each with its own time, and not a scene
_RECORDINGS = ("rotating-radar",)


@explains_wrong_types
def names() -> list[str]:
    """Names of all scenarios that make a scene."""
    return list(_SCENES)


@explains_wrong_types
def recording_names() -> list[str]:
    """Names of all scenarios that make a recording of plots."""
    return list(_RECORDINGS)


@explains_wrong_types
def parameters(name: str) -> type[Parameters]:
    """Return the parameter dataclass of a scenario; its fields' metadata have a "help" text.

    Raises
    ------
    InvalidInputError
        There is no scenario of that name.
    """
    if name not in _SCENES + _RECORDINGS:
        raise InvalidInputError(f"scenario: unknown name {name!r}; known: {', '.join(_SCENES + _RECORDINGS)}")
    kind = f"{name.title().replace('-', '')}Parameters"
    return cast("type[Parameters]", getattr(_module(name), kind))


def _module(name: str) -> ModuleType:
    return import_module(f"{__name__}.{name.replace('-', '_')}")


@explains_wrong_types
def simulate(name: str, seed: int | None = 0, **values: Any) -> Scene:
    """Simulate a scene.

    Parameters
    ----------
    name : str
        One of ``names()``.
    seed : int or None, default 0
        Seed of the random generator: the same seed gives the same scene; None: a random seed, found in its name.
    **values
        Parameters of the scenario (``parameters(name)``).

    Returns
    -------
    Scene
        With truth; named after the scenario, the seed and what differs from the defaults.

    Raises
    ------
    InvalidInputError
        Unknown scenario or parameter, or a value out of range.
    """
    if name in _RECORDINGS:
        raise InvalidInputError(f"scenario: {name!r} makes a recording, not a scene: use simulate_recording")
    return cast(Scene, _simulate(name, seed, values))


@explains_wrong_types
def simulate_recording(name: str, seed: int | None = 0, **values: Any) -> SimulatedPlots:
    """Simulate a recording of radar plots.

    Parameters
    ----------
    name : str
        One of ``recording_names()``.
    seed, **values
        As for `simulate`.

    Returns
    -------
    SimulatedPlots
        The recording, and the truth.
    """
    if name in _SCENES:
        raise InvalidInputError(f"scenario: {name!r} makes a scene, not a recording: use simulate")
    return cast("SimulatedPlots", _simulate(name, seed, values))


def _simulate(name: str, seed: int | None, values: dict[str, Any]) -> Any:
    kind = parameters(name)
    known = [field.name for field in fields(cast(Any, kind))]
    for key in values:
        if key not in known:
            raise InvalidInputError(f"{key}: no parameter of scenario {name!r}; known: {', '.join(known)}")
    missing = [f.name for f in fields(cast(Any, kind)) if f.default is MISSING and f.name not in values]
    if missing:
        raise InvalidInputError(f"{missing[0]}: scenario {name!r} needs a value")
    seed = whole_seed(seed)
    chosen = kind(**values)
    return _module(name).simulate(chosen, np.random.default_rng(seed), _title(name, seed, chosen))


def _title(name: str, seed: int, chosen: Parameters) -> str:
    """Name of the scene: the scenario, the seed, and the parameters that are not the defaults."""
    parts = [f"seed {seed}"]
    for field in fields(cast(Any, chosen)):
        value = getattr(chosen, field.name)
        # a file's name may be private and differs from machine to machine
        if value != field.default and field.metadata.get("in_title", True):
            parts.append(f"{field.name.replace('_', ' ')} {value}")
    return f"{name} ({', '.join(parts)})"
