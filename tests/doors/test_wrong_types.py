"""Every public function and class, each argument in turn of a wrong type: one line that says what was expected.

A new public function is tested at once: with wrong arguments everywhere, and with one wrong argument at a time where
examples.py has a good call of it.
"""

import importlib
import inspect
import warnings

import pytest

from assoc._system import wrong_types
from assoc.errors import AssocError
from tests.doors.examples import examples, scene
from tests.sizes import sample

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


def wrong_values():
    return [None, 3, 2.5, "strange", Strange(), [None], [3], {"a": 1}, lambda: 0, scene(), scene().sensors[0]]


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


@sample("name, argument", [(name, one) for name, given in examples().items() for one in given], every=4)
def test_one_wrong_argument(name, argument, tmp_path, monkeypatch):
    """What does not fit is refused, and the line names the argument or says of what kind it is."""
    monkeypatch.chdir(tmp_path)
    function, good = target(name), examples()[name]
    defaults = signature(function).parameters
    kinds = wrong_types.annotations_of(function.__init__ if inspect.isclass(function) else function)
    for value in wrong_values():
        # anything can stand for true or false, and a default is no wrong value
        if wrong_types.fits(value, kinds[argument]) or kinds[argument] is bool or value is defaults[argument].default:
            continue
        said = complaint(function, **{**good, argument: value})
        assert said, (name, argument, value)


def test_the_line_names_the_argument():
    import assoc

    assert complaint(assoc.build_problem, 0, scene()) == "scene: expected Scene, got 0"
    line = complaint(assoc.Scene, scene().sensors[0], [0.0], [])
    assert line.startswith("sensors: expected Sequence[Sensor], got Radar3D") and "\n" not in line


def test_doors_let_errors_of_other_kinds_through():
    """A mistake in a user's own function is the user's own error."""
    import assoc

    def callback(point):
        raise KeyError("mine")

    problem = assoc.build_problem(scene(), 0)
    with pytest.raises(KeyError, match="mine"):
        assoc.assign(problem, "aco", callback=callback)


def test_a_random_seed():
    """None is another seed each time, and results say which."""
    import assoc

    seeds = {assoc.associate(scene(), "greedy", seed=None).seed for _ in range(3)}
    assert len(seeds) == 3
    from assoc.simulation import simulate

    names = {simulate("three-radar", None, scans=1).name for _ in range(2)}
    assert len(names) == 2
    problem = assoc.build_problem(scene(), 0)
    assert assoc.assign(problem, "aco", seed=None).status == "optimal"
    study = assoc.sweeps.Study(problem, assoc.sweeps.grid("greedy", {})[0], seed=None)
    assert isinstance(study.seed, int) and [one.name for one in study.sources] == ["problem 1"]
