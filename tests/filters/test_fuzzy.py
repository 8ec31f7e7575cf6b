"""Fuzzy inference against scikit-fuzzy, and the filter that it adapts."""

import warnings

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.filters import (
    Alarm,
    CoordinatedTurn,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    FuzzyRules,
    FuzzyVariable,
    paper_rules,
)
from tests.filters.common import FLAT, MOTION, RADAR, random_state

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    skfuzzy = pytest.importorskip("skfuzzy")


@pytest.mark.parametrize("case", range(4))
def test_inference_against_scikit_fuzzy(case):
    rng = np.random.default_rng(case)
    if case == 0:
        rules = paper_rules()
    else:
        corners = [np.sort(rng.uniform(0, 5, 4)) for _ in range(3)] + [np.array([0, 0, 5, 5.0])]
        outs = [np.sort(rng.uniform(-2, 3, 4)) for _ in range(3)]
        rules = FuzzyRules(
            FuzzyVariable({f"i{k}": tuple(c) for k, c in enumerate(corners)}),
            FuzzyVariable({f"o{k}": tuple(c) for k, c in enumerate(outs)}),
            [("i0", "o1"), ("i1", "o0"), ("i2", "o2"), ("i3", "o1")],
            points=77,
        )
    inputs = rng.uniform(0, 5, 40)
    universe = rules.universe
    expected = []
    for x in inputs:
        total = np.zeros_like(universe)
        for i, o in rules.rules:
            degree = skfuzzy.trapmf(np.array([x]), rules.input.sets[i])[0]
            total = np.fmax(total, np.fmin(degree, skfuzzy.trapmf(universe, rules.output.sets[o])))
        expected.append(skfuzzy.defuzz(universe, total, "centroid"))
    np.testing.assert_allclose(rules(inputs), expected, rtol=1e-9)


def test_centres_make_a_partition():
    variable = FuzzyVariable.from_centres(["a", "b", "c"], [1.0, 2.0, 5.0], 0.5)
    rules = FuzzyRules(variable, variable, [("a", "a"), ("b", "b"), ("c", "c")], points=1001)
    assert rules(np.array([2.0]))[0] == pytest.approx(8 / 3, abs=1e-3)
    assert rules(np.array([-10.0]))[0] == rules(np.array([0.5]))[0]


def test_refusals():
    good = FuzzyVariable({"a": (0.0, 1.0, 2.0, 3.0)})
    with pytest.raises(InvalidInputError, match="corners in order"):
        FuzzyVariable({"a": (0.0, 2.0, 1.0, 3.0)})
    with pytest.raises(InvalidInputError, match="expected a pair"):
        FuzzyRules(good, good, [("a", "b")])
    with pytest.raises(InvalidInputError, match="inputs must be finite"):
        FuzzyRules(good, good, [("a", "a")])(np.array([np.nan]))
    gap = FuzzyVariable({"a": (0.0, 0.0, 1.0, 1.0), "b": (2.0, 2.0, 3.0, 3.0)})
    with pytest.raises(InvalidInputError, match="no rule covers 1.5"):
        FuzzyRules(gap, good, [("a", "a"), ("b", "a")])(np.array([1.5]))
    with pytest.raises(InvalidInputError, match="scale must not be negative"):
        bad = FuzzyVariable({"a": (-1.0, 0.0, 1.0, 2.0)})
        FuzzyAdaptiveEKF(MOTION, FuzzyRules(good, bad, [("a", "a")]))
    state = random_state(1, np.random.default_rng(0))
    with pytest.raises(InvalidInputError, match="components must be below 3"):
        one = FuzzyAdaptiveEKF(MOTION, paper_rules(), components=[3])
        one.update(one.start(state), RADAR.measure(state.mean[:, :3]), RADAR)


def test_equations_32_to_36():
    """One step with the paper's rules: q scales Q of the next prediction, r scales R of this correction."""
    state = random_state(1, np.random.default_rng(1))
    rules = paper_rules()
    fuzzy = FuzzyAdaptiveEKF(MOTION, rules, rules)
    F, Q = (one[0] for one in MOTION.matrices(1.0))
    predicted = fuzzy.predict(fuzzy.start(state), 1.0)
    z = RADAR.measure(predicted.mean[:, :3]) + 1.5 * RADAR.noise
    done = fuzzy.update(predicted, z, RADAR)
    plain = ExtendedKalmanFilter(MOTION)
    first = plain.update(plain.predict(state, 1.0), z, RADAR)
    alpha = np.mean(first.innovation[0] ** 2 / np.diag(first.covariance[0]))
    scale = rules(np.array([alpha]))[0]
    np.testing.assert_allclose(done.covariance[0], first.covariance[0] + (scale - 1) * RADAR.covariance, rtol=1e-9)
    after = fuzzy.predict(done.state, 1.0)
    P = done.state.covariance[0]
    np.testing.assert_allclose(after.covariance[0], F @ P @ F.T + scale * Q, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("immediate", [False, True])
def test_two_sensors_at_one_time(immediate):
    """The second corrects what the first left: with scales of 1 it is the EKF."""
    one = FuzzyVariable({"any": (0.0, 0.0, 9.0, 9.0)})
    rules = FuzzyRules(one, FuzzyVariable({"one": (0.5, 1.0, 1.0, 1.5)}), [("any", "one")])
    fuzzy, ekf = FuzzyAdaptiveEKF(MOTION, rules, immediate=immediate), ExtendedKalmanFilter(MOTION)
    start = random_state(1, np.random.default_rng(4))
    a, b = fuzzy.predict(fuzzy.start(start), 1.0), ekf.predict(start, 1.0)
    for sensor in (RADAR, FLAT):
        z = sensor.measure(b.mean[:, :3])
        a, b = fuzzy.update(a, z, sensor).state, ekf.update(b, z, sensor).state
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(a.mean, b.mean, rtol=1e-9, atol=1e-9)


def growing(low, high, inputs):
    """Rules whose output goes from `low` to `high` as their input grows."""
    names = ["low", "high"]
    sets = FuzzyVariable.from_centres(names, inputs, 1.0)
    return FuzzyRules(sets, FuzzyVariable.from_centres(names, [low, high], abs(low) / 50), [(n, n) for n in names])


def test_an_alarm_that_watches_the_turn_sees_what_the_gain_says_of_it():
    """The rules' input is |sum of K v / sqrt(K S K')|^2 / W with the turn rate's row of K, in plain numpy."""
    motion, rules = CoordinatedTurn(5.0, 0.02), growing(1.0, 9.0, [0.0, 30.0])
    first = FuzzyRules(rules.input, FuzzyVariable(dict.fromkeys(rules.output.sets, (0.1, 0.2, 0.2, 0.3))), rules.rules)
    fuzzy = FuzzyAdaptiveEKF(motion, first, others=[Alarm(2, [rules], watches="turn")])
    state = fuzzy.predict(fuzzy.start(random_state(4, np.random.default_rng(3), 7)), 1.0)
    rng, seen = np.random.default_rng(4), []
    for _ in range(3):
        z = RADAR.measure(state.mean[:, :3]) + 3 * rng.standard_normal((4, 3)) * RADAR.noise
        one = []
        for b in range(4):
            P, H = state.covariance[b], np.zeros((3, 7))
            H[:, :3] = RADAR.jacobian(state.mean[b : b + 1, :3])[0]
            S = H @ P @ H.T + RADAR.covariance
            row = P[6] @ H.T @ np.linalg.inv(S)
            v = RADAR.residual(z[b], RADAR.measure(state.mean[b : b + 1, :3])[0])
            one.append(row @ v / np.sqrt(row @ S @ row))
        seen.append(one)
        state = fuzzy.update(state, z, RADAR).state
        last = np.array(seen[-2:])
        expected = rules(last.sum(axis=0) ** 2 / len(last))
        np.testing.assert_allclose(state.process_scale, np.repeat(expected[:, None], 7, axis=1), rtol=1e-6)
        state = fuzzy.predict(state, 1.0)
