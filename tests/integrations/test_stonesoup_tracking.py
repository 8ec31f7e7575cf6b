"""Inside Stone Soup's trackers: against its own association, exhaustive search, and another hash order."""

import itertools
import os
import re
import tomllib
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import assoc
from assoc.simulation import simulate

pytest.importorskip("stonesoup")

from stonesoup.dataassociator.mfa import MFADataAssociator
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment, NearestNeighbour
from stonesoup.dataassociator.probability import JPDA, PDA, JPDAwithLBP
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.gater.distance import DistanceGater
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.initiator.simple import GaussianParticleInitiator, SimpleMeasurementInitiator
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.predictor.particle import ParticlePredictor
from stonesoup.resampler.particle import SystematicResampler
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.types.update import Update
from stonesoup.updater.kalman import ExtendedKalmanUpdater
from stonesoup.updater.particle import ParticleUpdater

from assoc.integrations.stonesoup import (
    AssignmentAssociator,
    AssignmentInitiator,
    FusionFeeder,
    SceneDetectionReader,
    adapt,
)
from assoc.integrations.stonesoup.ordering import sorted_detections
from tests.integrations.test_stonesoup_scenes import adapted, planar_model
from tests.running import printed, process

ROOT = Path(__file__).parents[2]
ZERO = datetime(2026, 1, 1)
PREDICTOR = KalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(1.0)] * 2))
UPDATER = ExtendedKalmanUpdater()
SENSOR = LinearGaussian(4, (0, 2), np.diag([4.0, 4.0]))


def crowd(seed, tracks=5, detections=7, spread=6.0):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, spread, (tracks, 2))
    known = {
        Track([GaussianState(StateVector([x, 0, y, 0]), np.diag([2.0, 0.1, 2.0, 0.1]), timestamp=ZERO)])
        for x, y in places
    }
    seen = [
        *places[: detections - 2] + rng.normal(0, 2.0, (min(tracks, detections - 2), 2)),
        *rng.uniform(0, 9, (2, 2)),
    ]
    time = ZERO + timedelta(seconds=1)
    return known, {Detection(StateVector(z), timestamp=time, measurement_model=SENSOR) for z in seen}, time


def by_distance(missed=3.0):
    return DistanceHypothesiser(PREDICTOR, UPDATER, Mahalanobis(), missed_distance=missed)


@pytest.mark.parametrize("seed", range(3))
def test_probabilities_against_all_joint_hypotheses(seed):
    tracks, detections, time = crowd(seed, tracks=4, detections=5)
    hypothesiser = PDAHypothesiser(PREDICTOR, UPDATER, clutter_spatial_density=0.02, prob_detect=0.8, prob_gate=0.99)
    associator = AssignmentAssociator(hypothesiser)
    ours = associator.associate(tracks, detections, time)
    offered = [list(hypothesiser.hypothesise(track, sorted_detections(detections), time)) for track in tracks]
    best = -np.inf
    for joint in itertools.product(*offered):
        used = [h.measurement for h in joint if h]
        if len(used) == len(set(used)):
            best = max(best, sum(float(h.probability.log_value) for h in joint))
    assert sum(float(h.probability.log_value) for h in ours.values()) == pytest.approx(best)
    assert associator.solution.status == "optimal"


def test_fusion_is_the_association_of_the_scene():
    scene = simulate("three-radar", seed=1, scans=6)
    sensors = adapted(scene)
    feeder = FusionFeeder(SceneDetectionReader(scene), sensors, region=scene.region, solver="exact")
    expected = assoc.associate(scene)
    for k, (_, fused) in enumerate(feeder):
        want = expected.scans[k]
        order, theirs = [np.argsort(p[:, 0]) for p in (want.positions, np.array([place(d) for d in fused]))]
        fused = [list(fused)[i] for i in theirs]
        np.testing.assert_allclose([place(d) for d in fused], want.positions[order], rtol=1e-6)
        np.testing.assert_allclose(
            [d.measurement_model.covar() for d in fused], want.covariances[order], rtol=1e-4, atol=1e-2
        )
        for detection, chosen in zip(fused, want.targets[order].tolist(), strict=True):
            sources = detection.metadata["sources"]
            assert [one.metadata["measurement"] if one else 0 for one in sources] == chosen
            assert detection.measurement_model.mapping == (0, 2, 4)
        assert feeder.association.solution.cost == pytest.approx(want.solution.cost)


def place(detection):
    return np.asarray(detection.state_vector, dtype=float).ravel()


def test_two_radars_in_the_plane_against_least_squares():
    """Position and covariance of a planar fusion, from the textbook, with no height anywhere."""
    from scipy.optimize import least_squares

    models = [planar_model(0.0, 0.0), planar_model(8e3, 1e3)]
    target = np.array([3e3, 5e3])
    rng = np.random.default_rng(0)
    sigma = np.sqrt(np.diag(models[0].covar()))
    vectors = [np.array([np.arctan2(*d[::-1]), np.hypot(*d)]) for d in (target, target - [8e3, 1e3])]
    vectors = [v + rng.normal(0.0, sigma) for v in vectors]
    stream = [
        (ZERO, {Detection(StateVector(v), timestamp=ZERO, measurement_model=m)})
        for v, m in zip(vectors, models, strict=True)
    ]

    def residuals(at):
        parts = [(at, vectors[0]), (at - [8e3, 1e3], vectors[1])]
        return np.concatenate([(np.array([np.arctan2(*d[::-1]), np.hypot(*d)]) - v) / sigma for d, v in parts])

    fit = least_squares(residuals, target, xtol=1e-14, ftol=1e-14)
    [(_, fused)] = list(FusionFeeder(stream, [adapt(m, max_range=2e4) for m in models]))
    [one] = fused
    np.testing.assert_allclose(place(one), fit.x, atol=1e-3)
    np.testing.assert_allclose(one.measurement_model.covar(), np.linalg.inv(fit.jac.T @ fit.jac), rtol=1e-3)
    assert (one.measurement_model.ndim_state, one.measurement_model.mapping) == (4, (0, 2))


def near(pda):
    return DistanceHypothesiser(pda.predictor, pda.updater, Mahalanobis(), missed_distance=3.0)


def gated(pda):
    return DistanceGater(pda, Mahalanobis(), 5.0)


PAIRS = {
    "nearest": lambda pda: NearestNeighbour(near(pda)),
    "assigned": lambda pda: GNNWith2DAssignment(near(pda)),
    "one mixture": PDA,
    "mixture": JPDA,
    "mixture by belief propagation": JPDAwithLBP,
    "gated mixture": lambda pda: JPDA(gated(pda)),
    "frames": lambda pda: MFADataAssociator(MFAHypothesiser(pda), slide_window=3),
    "gated frames": lambda pda: MFADataAssociator(gated(MFAHypothesiser(gated(pda))), slide_window=3),
    "ours": lambda pda: AssignmentAssociator(pda, solver="greedy"),
}


@pytest.mark.parametrize("particles", [False, True])
@pytest.mark.parametrize("kind", PAIRS)
def test_an_initiator_for_every_hypothesiser_and_associator(kind, particles):
    updater, prior = UPDATER, GaussianState(np.zeros((4, 1)), np.diag([0.0, 25.0, 0.0, 25.0]), timestamp=ZERO)
    predictor, first = PREDICTOR, None
    if particles:
        predictor, updater = ParticlePredictor(PREDICTOR.transition_model), ParticleUpdater(None, SystematicResampler())
        first = GaussianParticleInitiator(SimpleMeasurementInitiator(prior, SENSOR))
    pda = PDAHypothesiser(predictor, updater, clutter_spatial_density=1e-4, prob_detect=0.9, prob_gate=0.999)
    associator = PAIRS[kind](pda)
    deleter = UpdateTimeStepsDeleter(3)
    initiator = AssignmentInitiator(prior, deleter, associator, updater, min_points=3, initiator=first)
    assert (initiator.data_associator is associator) == (kind == "ours")
    for k in range(4):
        time = ZERO + timedelta(seconds=k)
        seen = {Detection(StateVector([x + 5 * k, 0.0]), timestamp=time, measurement_model=SENSOR) for x in (0, 500)}
        tracks = initiator.initiate(seen, time)
        assert len(tracks) == (2 if k == 2 else 0)
        assert all(isinstance(state, Update) for track in tracks for state in track)


def test_stone_soup_finds_the_plugin(tmp_path):
    """By the entry point of pyproject.toml, whether or not this tree's installation is as new as it."""
    with open(ROOT / "pyproject.toml", "rb") as file:
        points = tomllib.load(file)["project"]["entry-points"]["stonesoup.plugins"]
    about = tmp_path / "plugin-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[stonesoup.plugins]\nassoc = {points['assoc']}\n")
    script = "from stonesoup.plugins.assoc import AssignmentInitiator, FusionFeeder"
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    printed("-W", "error", "-c", script, PYTHONPATH=path)


PAGE = (ROOT / "docs" / "stonesoup.md").read_text(encoding="utf-8")
PRINTED = re.findall(r"\{literalinclude\} stonesoup/(\w+)\.py\n```\n(?:\n```text\n(.*?)```)?", PAGE, re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "expected"), [one for one in PRINTED if one[1]])
def test_the_page_runs_as_printed(name, expected):
    """In a process of its own, as a user does; a GOSPA within a metre, since sets have another order each time."""
    done = process(ROOT / "docs" / "stonesoup" / f"{name}.py", PYTHONPATH=ROOT)
    assert done.returncode == 0, done.stderr
    shown, told = (re.split(r"(\d+) m\n", text) for text in (done.stdout, expected))
    assert shown[::2] == told[::2]
    np.testing.assert_allclose([int(one) for one in shown[1::2]], [int(one) for one in told[1::2]], atol=1)
