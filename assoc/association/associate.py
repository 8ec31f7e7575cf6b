"""``associate``: the entrance from a scene to its association."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from assoc._parameters import whole_seed
from assoc._system.interrupts import interruptible
from assoc._system.wrong_types import explains_wrong_types
from assoc.association.association import Association
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene


@explains_wrong_types
@interruptible()
def associate(
    scene: Scene,
    solver: str = "exact",
    *,
    seed: int | None = 0,
    time_limit: float | None = None,
    jobs: int = 1,
    gating: Mapping[str, Any] | None = None,
    marginals: bool = False,
    **parameters: Any,
) -> Association:
    """Find for every scan which measurements come from the same target, and which are false alarms.

    Parameters
    ----------
    scene : Scene
    solver : str, default "exact"
        One of ``assoc.solvers.names()``.
    seed : int or None, default 0
        The same seed gives the same associations, whatever the number of processes; None: a random one, which the
        result has.
    time_limit : float, optional
        Seconds for each scan; when they are over the best solution found is taken.
    jobs : int, default 1
        Number of processes.
    gating : mapping, optional
        Options of ``assoc.build_problem``: ``gate_probability``, ``max_tuples``, ``speed``, ``target_density``,
        ``all_tuples``.
    marginals : bool, default False
        Whether to compute how probable each target is (``ScanAssociation.probabilities``, ``assoc.marginals``).
    **parameters
        Parameters of the solver (``assoc.solvers.parameters(solver)``).

    Returns
    -------
    Association

    Raises
    ------
    InvalidInputError
        An argument is not as described.
    LimitExceededError
        A scan has too many candidate tuples.
    """
    # loads the compiler, which an Association by itself does not need
    from assoc.association.solving import ScanOptions, associate_scans, gathered

    if not isinstance(scene, Scene):
        raise InvalidInputError(f"scene: expected a Scene, got {type(scene).__name__}")
    gates = {} if gating is None else gating
    options = ScanOptions(solver, whole_seed(seed), time_limit, parameters, gates, marginals=bool(marginals))
    return gathered(associate_scans((scene,), options, jobs=jobs), options)
