"""Every public function and class with arguments of a wrong type: one line that says what was expected."""

import importlib
import inspect
import warnings
from collections.abc import Sequence

import numpy as np
import pytest

import assoc
from assoc._system import wrong_types
from assoc.errors import AssocError
from assoc.simulation import simulate

ROOMS = [
    "assoc", "assoc.costs", "assoc.filters", "assoc.metrics", "assoc.plotting", "assoc.plotting.report", "assoc.proofs",
    "assoc.recordings", "assoc.registration", "assoc.scene", "assoc.sensors", "assoc.simulation", "assoc.solvers",
    "assoc.sweeps", "assoc.tracking",
]  # fmt: skip
# classes that users make; all others are results, parameters (which check themselves), or parts of filters
MADE = {
    "AssignmentProblem", "Scene", "Truth", "BearingSensor", "PositionSensor", "Radar2D", "Radar3D", "Study", "Setting",
    "Trajectories", "Trajectory", "Recording", "MultiSensorTracker", "StaticFusionTracker", "TrackOrientedMHT",
    "HypothesisOrientedMHT", "NearestNeighbourTracker", "JointProbabilisticTracker", "LatePlots", "LiveTracker",
}  # fmt: skip


class Strange:
    """An object that nothing expects."""


def public_names():
    for room in ROOMS:
        module = importlib.import_module(room)
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isfunction(value) or (inspect.isclass(value) and name in MADE):
                yield f"{room}.{name}"


def signature(function):
    return inspect.signature(function)


def complaint(call, *args, **keywords):
    """What a call says of its arguments; None where it does not complain."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            call(*args, **keywords)
        except AssocError as error:
            assert "\n" not in str(error) and 5 < len(str(error)) < 500, str(error)
            return str(error)
    return None


def target(name):
    room, _, plain = name.rpartition(".")
    return getattr(importlib.import_module(room), plain)


@pytest.mark.parametrize("name", [*public_names()])
def test_wrong_everywhere(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = target(name)
    needed = [
        one for one in signature(function).parameters.values()
        if one.default is one.empty and one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)
    ]  # fmt: skip
    kinds = wrong_types.annotations_of(function.__init__ if inspect.isclass(function) else function)
    for value in [None, Strange(), 3]:
        if not all(wrong_types.fits(value, kinds.get(one.name)) for one in needed):
            assert complaint(function, **{one.name: value for one in needed}), (name, value)


@pytest.fixture(scope="module")
def scene():
    return simulate("three-radar", 1, scans=2)


@pytest.mark.parametrize(
    ("name", "argument", "value"),
    [
        ("assoc.assign", "solver", 3), ("assoc.assign", "time_limit", "soon"), ("assoc.assign", "callback", 5),
        ("assoc.kbest", "k", 2.5), ("assoc.build_problem", "scan", [None]), ("assoc.associate", "gating", [3]),
        ("assoc.associate", "jobs", "all"), ("assoc.marginals", "time_limit", {"a": 1}),
    ],
)  # fmt: skip
def test_one_wrong_argument(name, argument, value, scene):
    """What does not fit is refused, and the line names the argument or says of what kind it is."""
    problem = name in ("assoc.assign", "assoc.kbest", "assoc.marginals")
    good = {"problem": assoc.build_problem(scene, 0)} if problem else {"scene": scene}
    good |= {"assoc.kbest": {"k": 2}, "assoc.build_problem": {"scan": 0}}.get(name, {})
    assert argument in complaint(target(name), **{**good, argument: value})


@pytest.mark.parametrize(
    ("kind", "fit", "unfit"),
    [
        ("int", (3, np.int64(3)), (True, 2.5, 3.0, "3", None)),
        ("float", (3, 2.5, np.float32(1.0)), (True, "2.5", 1j, None)),
        ("bool", (True, np.bool_(False)), (1, "yes", None)),
        ("str | None", ("a", None), (b"a", 3)),
        (Sequence[int], ([], (1, 2)), (3, "12", [1, 2.5])),
    ],
)
def test_what_fits_an_annotation(kind, fit, unfit):
    def function(value):
        raise TypeError("deep inside")

    function.__annotations__["value"] = kind
    explaining = wrong_types.explains_wrong_types(function)
    for value in fit:
        with pytest.raises(TypeError, match="deep inside"):
            explaining(value)
    for value in unfit:
        assert complaint(explaining, value).startswith(f"value: expected {kind}, got "), value


def test_the_line_names_the_argument(scene):
    assert complaint(assoc.build_problem, 0, scene) == "scene: expected Scene, got 0"
    line = complaint(assoc.Scene, scene.sensors[0], [0.0], [])
    assert line.startswith("sensors: expected Sequence[Sensor], got Radar3D") and "\n" not in line


def test_errors_of_other_kinds_come_through(scene):
    """A mistake in a user's own function is the user's own error."""

    def callback(point):
        raise KeyError("mine")

    problem = assoc.build_problem(scene, 0)
    with pytest.raises(KeyError, match="mine"):
        assoc.assign(problem, "aco", callback=callback)


def test_a_random_seed(scene):
    """None is another seed each time, and results say which."""
    seeds = {assoc.associate(scene, "greedy", seed=None).seed for _ in range(3)}
    assert len(seeds) == 3
    names = {simulate("three-radar", None, scans=1).name for _ in range(2)}
    assert len(names) == 2
    problem = assoc.build_problem(scene, 0)
    assert assoc.assign(problem, "aco", seed=None).status == "optimal"
    study = assoc.sweeps.Study(problem, assoc.sweeps.grid("greedy", {})[0], seed=None)
    assert isinstance(study.seed, int) and [one.name for one in study.sources] == ["problem 1"]
