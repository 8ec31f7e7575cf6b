"""Codes and addresses as evidence: Bayes by enumeration, aircraft that cross, wrong codes, saved trackers."""

import itertools

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.recordings import Recording, clustering_time_window, radar_of
from assoc.sensors import PositionSensor, Radar2D
from assoc.tracking import TRACKERS, IdentityParameters, Initiation
from assoc.tracking.filter_choice import two_speeds
from assoc.tracking.offline.plots import track_plots
from assoc.tracking.records.identity_evidence import LARGEST, MEMORY, Identities, log_ratio
from tests.sizes import few_or_all, sample
from tests.tracking.crossing import TURN, crossing, radar

NAMES = ("mht", "mht-hypothesis", "nearest-neighbour", "joint-probabilistic")


def by_enumeration(told, given, count, garbled, shared):
    """Sum over every code that the aircraft may have, by Bayes' rule from the definition alone."""

    def likely(d, c):
        return (1.0 - garbled) * (d == c) + garbled / count

    # code 0 stands for unknown: codes are 1 to N
    posterior = np.array([np.prod([likely(d, c) for d in told if d]) for c in range(1, count + 1)])
    posterior /= posterior.sum()
    own = sum(w * likely(given, c) for c, w in enumerate(posterior, start=1))
    other = sum(w * (shared * (given == c) + (1.0 - shared) / count) for c, w in enumerate(posterior, start=1))
    return np.log(own / other)


@few_or_all("every", 7, 1)
@pytest.mark.parametrize(("garbled", "shared"), [(0.02, 0.01), (0.3, 0.2), (1e-6, 0.5)])
def test_log_ratio_is_bayes_by_enumeration(garbled, shared, every):
    count = 5
    cases = list(itertools.product(range(count + 1), repeat=4))[::every]
    told, given = np.array([case[:3] for case in cases]), np.array([case[3] for case in cases])
    found, best = log_ratio(told, given, count, garbled, shared)
    for row, case in enumerate(cases):
        known = [d for d in case[:3] if d]
        expected = by_enumeration(case[:3], case[3], count, garbled, shared) if known and case[3] else 0.0
        assert found[row] == pytest.approx(expected, abs=1e-9), case
        most = max((known.count(d) for d in known), default=0)
        assert (best[row] == 0) if not known else known.count(best[row]) == most


def test_what_identities_say():
    p = IdentityParameters()
    none = Identities(p)
    ids = np.array([7, 7, 7, 9])
    plots = np.array([[1234, 0], [4321, 0], [0, 0], [1234, 0]])
    assert none.evidence(ids, plots)[0].tolist() == [0.0] * 4
    one = none.after([np.array([7, 9, 0])], [np.array([[1234, 0], [0, 0], [1, 1]])], np.array([7, 9, 9]))
    said = one.evidence(ids, plots)
    assert said[0][0] > 4 and -4.5 < said[0][1] < -3 and said[0][2:].tolist() == [0.0, 0.0]
    assert said[1].all()
    # a code that was told more often is surer, and a new one is believed after some plots
    for _ in range(MEMORY):
        assert one.evidence(ids[:1], plots[1:2])[0][0] < 5
        one = one.after([np.array([7])], [plots[1:2]], np.array([7]))
    assert one.evidence(ids[:2], plots[:2])[0].tolist() == pytest.approx([-3.9, 4.6], abs=0.1)
    # nothing is kept of tracks that are gone
    assert len(one.after([], [], np.array([3])).arrays()["identity.ids"]) == 0


def test_another_address_is_not_in_the_gate():
    known = Identities(IdentityParameters())
    known = known.after([np.array([1, 2])], [np.array([[1000, 0xABCDEF], [1000, 0]])], np.array([1, 2]))
    plots = np.array([[1000, 0x123456], [2000, 0xABCDEF], [1000, 0]])
    said = known.evidence(np.array([1, 1, 1]), plots)
    assert said[1].tolist() == [False, True, True]
    # the address counts alone where it is known: the garbled code beside it changes nothing
    assert said[0][1] == pytest.approx(known.evidence(np.array([1]), np.array([[0, 0xABCDEF]]))[0][0])
    assert said[0][1] > 8 and said[0][2] > 4
    # a track that has told a code only is judged by the code
    assert known.evidence(np.array([2]), plots[:1])[1].all()


def followed(name, recording, identity):
    tracker = TRACKERS[name]([radar(recording)], identity=identity)
    return track_plots(tracker, recording, clustering_time_window(recording, TURN))


def taken(done, aircraft):
    """The tracks that took this aircraft's plots, in the order of time."""
    rows = np.concatenate([window.rows for window in done.windows])
    return done.tracks[done.recording.sources[rows] == aircraft]


@few_or_all("seeds", 2, 10)
@sample("name, address", [(name, address) for name in NAMES for address in (False, True)], every=5)
def test_codes_keep_crossing_aircraft_apart(name, address, seeds):
    switched = {"use": 0, "ignore": 0}
    for seed in range(seeds):
        recording = crossing(seed, address=address)
        for how, identity in (("use", IdentityParameters()), ("ignore", None)):
            done = followed(name, recording, identity)
            for aircraft in (0, 1):
                tracks = taken(done, aircraft)
                tracks = tracks[tracks > 0]
                switched[how] += int((np.diff(tracks) != 0).sum())
    assert switched["use"] == 0 and switched["ignore"] > 0


@sample("name", NAMES, every=3)
def test_one_wrong_code_does_not_break_a_track(name):
    done = followed(name, crossing(3, wrong=(12, 30)), IdentityParameters())
    tracks = taken(done, 0)
    own = np.unique(tracks[(tracks > 0) & (np.arange(len(tracks)) > 3)])
    # garbled plots may be left to no track, or begin one; the others are all of one
    usual = [k for k in range(5, len(tracks)) if k not in (12, 30)]
    assert len(np.unique(tracks[usual])) == 1 and tracks[usual][0] in own


@sample("name", NAMES, every=3)
def test_wrong_ids_of_ships_break_no_track(name):
    """A radar, and reports of position (AIS) of which some have the other ship's id, or a stranger's."""
    rng, view = np.random.default_rng(5), [[-2e4, 2e4], [-2e4, 2e4]]
    sensors = [
        Radar2D(position=[0, 0, 0], noise=[30, 4e-3], field_of_view=[[0, 2e4], [-np.pi, np.pi]], false_alarm_rate=1),
        PositionSensor(position=[0, 0, 0], noise=[10, 10], field_of_view=view, false_alarm_rate=0.1),
    ]
    tracker = TRACKERS[name](sensors, two_speeds(1.0, 2), region=[*view, [0, 1]], initiation=Initiation(speed=8.0),
                             identity=IdentityParameters())  # fmt: skip
    ids = []
    for k in range(30):
        ships = np.array([[5e3 + 30.0 * k, 4e3, 0], [5.5e3 + 30.0 * k, 5e3, 0]])
        measured = [one.measure(ships) + rng.normal(0.0, one.noise, (2, 2)) for one in sensors]
        address = {14: (0xB, 0xA), 20: (0xC, 0xB), 24: (0xA, 0xA)}.get(k, (0xA, 0xB))
        codes = [np.zeros((2, 2), dtype=int), np.column_stack([[0, 0], address])]
        tracker.step(4.0 * k, measured, identities=codes)
        shown = [track for track in tracker.tracks if track.reported]
        if k >= 8:
            ids.append([min(shown, key=lambda t: np.linalg.norm(t.position - ship)).track_id for ship in ships])
            assert len(shown) == 2
    assert len({tuple(pair) for pair in ids}) == 1 and len({*ids[0]}) == 2


@sample("name", NAMES, every=3)
def test_identities_without_codes_change_nothing(name):
    recording = crossing(2)
    bare = Recording(recording.times, recording.ranges, recording.azimuths, sources=recording.sources)
    with_model, without = followed(name, bare, IdentityParameters()), followed(name, bare, None)
    np.testing.assert_array_equal(with_model.tracks, without.tracks)


def test_bad_identities_are_refused():
    recording = crossing(0)
    own = radar_of(recording, range_noise=100.0, azimuth_noise=2e-3)
    with pytest.raises(InvalidInputError, match="identity must be IdentityParameters"):
        TRACKERS["mht"]([own], identity="use")
    tracker = TRACKERS["mht"]([own], identity=IdentityParameters())
    z = recording.measurements[:2]
    for bad, words in (
        ([], "one array for each of 1 sensors"),
        ([np.zeros((2, 1), dtype=int)], "of shape"),
        ([np.zeros((2, 2))], "whole numbers"),
        ([np.array([[-2, 0], [0, 0]])], "from 0 .or -1: none. to"),
        ([np.array([[0, LARGEST + 1], [0, 0]])], "from 0 .or -1: none. to"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            tracker.step(10.0, [z], identities=bad)
    assert tracker.num_steps == 0
    for name in ("code_garbled", "address_shared"):
        with pytest.raises(InvalidInputError, match=name):
            IdentityParameters(**{name: 1.0})


@pytest.mark.parametrize("name", ["multi-sensor", "static"])
def test_identities_of_several_sensors_join_the_score(name):
    """A plot of two radars with the track's own code counts for it; with its address contradicted it is not taken."""
    from assoc import simulation

    scene = simulation.simulate("crowd", 1, targets=1, scans=6, sensor="radar", width=20_000.0)
    results = {}
    for how, address in (("own", 0xABC), ("other", 0xDEF)):
        tracker = TRACKERS[name].for_scene(scene, identity=IdentityParameters())
        for k in range(6):
            scan = scene.scan(k)
            told = 0xABC if k < 5 else address
            known = [np.tile([0, told], (len(z), 1)) for z in scan.measurements]
            step = tracker.step(scan.time, scan.measurements, identities=known)
        sure = [track for track in tracker.tracks if track.confirmed and track.started < 2]
        results[how] = (sure[0].score, sum((one == sure[0].track_id).sum() for one in step.assigned))
    assert results["own"][0] > results["other"][0] + 8
    assert results["own"][1] >= 2 and results["other"][1] == 0
