"""Wrong identities are told by name, once; garbled ones, changes of tracks and of codes are not."""

import io
import sys

import numpy as np
import pytest

from assoc import live
from assoc.scene import Scene
from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS, IdentityParameters, track_scene
from assoc.tracking.adapting.identity_watch import MOST, IdentityWatch, TrackLookup
from assoc.tracking.records.identity_evidence import ship

A, B, C = 0x3C6444, 0x4B1A22, 0x400001


def sensor(name):
    return PositionSensor(
        name=name, position=[0.0, 0.0, 0.0], noise=[10.0, 10.0], detection_probability=0.95, false_alarm_rate=0.01,
        field_of_view=[[-2e4, 2e4], [-2e4, 2e4]],
    )  # fmt: skip


SENSORS = [sensor("radar"), sensor("AIS")]
NAMES = ["radar", "AIS"]


def told(*plots, decimal=False, near=(), column=1, used=False):
    """What is found of plots (time, sensor, track, number), one in each step; `near`: tracks in one place."""
    watch = IdentityWatch(decimal=decimal)
    lookup = TrackLookup(lambda track: [other for other in near if other != track and track in near], set)
    for k, (time, s, track, number) in enumerate(plots):
        pairs = [np.zeros((0, 2), dtype=np.int64)] * 2
        pairs[s] = np.zeros((1, 2), dtype=np.int64)
        pairs[s][0, column] = number
        taken = [np.full(len(pair), track) for pair in pairs]
        before, text = watch, watch.text()
        watch = watch.after(k, time, NAMES, taken, [ids > 0 for ids in taken], None, pairs, lookup, used=used)
        assert before.text() == text and IdentityWatch.restored(watch.text()) == watch
    return [str(odd) for odd in watch.found]


def every(begin, end, *rest, step=1.0):
    return [(float(time), *rest) for time in np.arange(begin, end, step)]


def test_an_address_that_changes():
    plots = [*every(0, 10, 1, 7, A), *every(10, 20, 1, 7, B)]
    assert told(*plots) == ["track 7: address 3c6444 became 4b1a22 (AIS), 15 s"]
    # once, whatever comes after; single garbled ones are nothing
    assert len(told(*plots, (20, 1, 7, A), (21, 1, 7, B), (22, 1, 7, C), (23, 1, 7, C), *every(24, 30, 1, 7, B))) == 1
    # a code may change in flight
    assert told(*plots, column=0) == []
    # a station on shore has an MMSI that could be an address
    shore = [(time, s, track, ship(2110001) if number == A else ship(211000002)) for time, s, track, number in plots]
    assert told(*shore) == ["track 7: address 002110001 became 211000002 (AIS), 15 s"]


def test_tracks_that_swap_plots_are_no_fault_of_identities():
    right = sorted([*every(0, 10, 1, 7, A), *every(0.5, 10, 1, 9, B)])
    swapped = sorted([*every(10, 40, 1, 7, B), *every(10.5, 40, 1, 9, A)])
    assert told(*right, *swapped) == []
    # the one has ended, or has plots that no track takes, or another track goes on
    alone = [*every(10, 40, 1, 7, B)]
    assert told(*right, *alone) == []
    fresh = [*every(0, 10, 1, 7, A)]
    assert told(*fresh, *sorted([*alone, *every(10.5, 40, 1, 0, A)])) == []
    assert told(*fresh, *sorted([*alone, *every(12.5, 40, 1, 11, A)])) == []
    # two sensors' plots are exchanged for long, in any order
    both = sorted([*every(10, 60, 0, 7, A), *every(10.1, 60, 0, 9, B), *every(10.2, 60, 1, 7, B),
                   *every(10.3, 60, 1, 9, A)])  # fmt: skip
    assert told(*right, *both) == []
    rng = np.random.default_rng(0)
    for _ in range(50):
        order = rng.integers(0, 2, 60)
        mixed = [plot for k, swap in enumerate(order.tolist())
                 for plot in ((10.0 + k, 1, (7, 9)[swap], A), (10.5 + k, 1, (9, 7)[swap], B))]  # fmt: skip
        assert told(*right, *mixed) == []


def test_two_sensors_that_disagree():
    plots = sorted([*every(0, 60, 0, 7, A), *every(0.5, 60, 1, 7, B, step=10.0)])
    assert told(*plots) == ["track 7: address 3c6444 by radar, 4b1a22 by AIS, 20.5 s"]
    # a new code is first said by one radar and then by the other
    change = sorted([*every(0, 20, 0, 7, 0o21), *every(0.5, 18, 1, 7, 0o21, step=4.0), *every(20, 40, 0, 7, 0o22),
                     *every(20.5, 40, 1, 7, 0o22, step=4.0)])  # fmt: skip
    assert told(*change, column=0) == []


def test_one_address_on_two_tracks():
    both = sorted([*every(0, 10, 1, 7, A), *every(0.5, 10, 1, 9, A)])
    assert told(*both) == ["address 3c6444 is that of tracks 7 and 9 at once (AIS), 2.5 s"]
    assert told(*both, decimal=True, column=1) == told(*both)
    # two tracks of one target
    assert told(*both, near=(7, 9)) == []
    # a track that ends and another that goes on are one aircraft, also if the old one takes a plot once more
    after = [*every(0, 10, 1, 7, A), *every(10, 20, 1, 9, A), (20, 1, 7, A), *every(21, 30, 1, 9, A)]
    assert told(*after) == []
    # codes that end in 00 are of many, others of one
    for base, decimal in ((8, False), (10, True)):
        some = sorted([*every(0, 10, 0, 7, 2 * base**3), *every(0.5, 10, 0, 9, 2 * base**3)])
        one = [(time, s, track, number + 1) for time, s, track, number in some]
        assert told(*some, decimal=decimal, column=0) == []
        assert told(*one, decimal=decimal, column=0) == ["code 2001 is that of tracks 7 and 9 at once (radar), 2.5 s"]
    ships = [(time, s, track, 211234567) for time, s, track, _ in both]
    assert told(*ships) == ["address 211234567 is that of tracks 7 and 9 at once (AIS), 2.5 s"]


def test_mixed_plots_are_told_as_one_address_on_two_tracks():
    plots = sorted([*every(0, 40, 0, 7, A), *every(0.5, 40, 1, 7, B), *every(0.2, 40, 0, 9, B)])
    assert ["at once" in line for line in told(*plots)] == [True]


def test_a_new_address_that_began_its_own_track():
    plots = [*every(0, 10, 1, 7, A), *every(12, 20, 1, 9, B)]
    assert told(*plots, near=(7, 9), used=True) == ["track 7 goes on as 9: address 3c6444 became 4b1a22 (AIS), 17 s"]
    assert told(*plots, used=True) == told(*plots, near=(7, 9)) == []
    # two targets that met
    still = sorted([*plots, *every(12.5, 40, 1, 7, A)])
    assert told(*still, near=(7, 9), used=True) == []


def test_memory_is_bounded():
    watch, pairs, lookup = IdentityWatch(), np.zeros((2, 2), dtype=np.int64), TrackLookup(lambda _: (), set)
    for k in range(10 * MOST):
        pairs[:, 1] = 1 + k // 9
        taken = [np.array([1, 2 + k])]
        watch = watch.after(k, float(k), NAMES[:1], taken, [np.array([True, False])], None, [pairs[:, :]], lookup)
    assert len(watch.series) < 400 and len(watch.numbers) < 400 and len(watch.changes) < 400
    assert len(watch.found) == MOST


@pytest.fixture(scope="module")
def ships():
    """A radar without identities, and AIS: two ships, of which one changes its id and then takes that of the other."""
    rng, times, start = np.random.default_rng(0), 3.0 * np.arange(60), np.array([[0.0, 0.0], [4e3, 3e3]])
    plots, names = [], []
    for k, time in enumerate(times):
        where = start + time * np.array([[8.0, 0.0], [0.0, -6.0]])
        due = k % 3 == 0
        plots.append([where + rng.normal(0, 10, (2, 2)), (where + rng.normal(0, 10, (2, 2)))[: 2 * due]])
        second = 211000002 if k < 25 else 211000009 if k < 45 else 211000001
        names.append([np.zeros((2, 2), dtype=int), np.array([[0, 211000001], [0, second]])[: 2 * due]])
    everywhere, never = [-np.pi, np.pi], [0.0, 0.0]
    scene = Scene(SENSORS, times, plots, [[-2e4, 2e4], [-2e4, 2e4], [0, 1]], sectors=[[everywhere, never]] * len(times))
    return scene, names


def test_health_names_them(ships):
    scene, names = ships
    tracker = TRACKERS["multi-sensor"].for_scene(scene, targets="ship", adapt=True)
    for k, known in enumerate(names):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements, sectors=scan.sectors, identities=known)
    one, two = sorted(track.track_id for track in tracker.tracks if track.confirmed)
    other = next(int(str(odd).split(":")[0].split()[1]) for odd in tracker.health.identities if "became" in str(odd))
    assert other in (one, two)
    lines = [str(odd).rpartition(", ")[0] for odd in tracker.health.identities]
    assert lines == [
        f"track {other}: address 211000002 became 211000009 (AIS)",
        f"address 211000001 is that of tracks {one} and {two} at once (AIS)",
    ]
    assert str(tracker.health).splitlines()[-2:] == [str(odd) for odd in tracker.health.identities]


def test_it_goes_back_with_the_tracker_and_is_saved(ships, tmp_path):
    scene, names = ships
    tracker = TRACKERS["multi-sensor"].for_scene(scene, targets="ship", adapt=True)

    def steps(first, last):
        for k in range(first, last):
            scan = scene.scan(k)
            tracker.step(scan.time, scan.measurements, sectors=scan.sectors, identities=names[k])

    steps(0, 38)
    middle = tracker.state
    tracker.save(tmp_path / "state.npz")
    steps(38, 60)
    found = tracker.odd_identities
    assert len(found) == 2
    tracker.state = middle
    assert tracker.odd_identities == ()
    steps(38, 60)
    assert tracker.odd_identities == found
    tracker.restore(tmp_path / "state.npz")
    steps(38, 60)
    assert tracker.odd_identities == found


def crossing(seed, wrong=None, abreast=False):
    """A radar and a second sensor, both with addresses; two targets that meet. `wrong`: the number B becomes."""
    rng, times, plots, names = np.random.default_rng(seed), 4.0 * np.arange(40), [], []
    angle = 0.0 if abreast else 0.15
    velocity = 100.0 * np.array([[np.cos(angle), np.sin(angle)], [np.cos(angle), -np.sin(angle)]])
    apart = np.array([[0.0, 15.0], [0.0, -15.0]]) if abreast else np.zeros((2, 2))
    for time in times:
        where, of = apart + (time - times[20]) * velocity, np.array([A, wrong if wrong and time > 100 else B])
        scan, known = [], []
        for _ in range(2):
            seen = rng.random(2) < 0.9
            false = rng.uniform(-2e4, 2e4, (rng.poisson(2), 2))
            scan.append(np.concatenate([(where + rng.normal(0, 10, (2, 2)))[seen], false]))
            numbers = np.concatenate([of[seen], np.zeros(len(false), dtype=int)])
            known.append(np.stack([np.zeros_like(numbers), numbers], axis=1))
        plots.append(scan)
        names.append(known)
    return Scene(SENSORS, times, plots, [[-2e4, 2e4], [-2e4, 2e4], [0, 1]]), names


def odd(name, scene, names, **options):
    tracker = TRACKERS[name].for_scene(scene, **options)
    track_scene(tracker, scene, identities=names)
    return [str(one) for one in tracker.odd_identities]


@pytest.mark.parametrize("name", ["multi-sensor", "nearest-neighbour", "mht"])
@pytest.mark.parametrize("abreast", [False, True])
def test_where_targets_meet_right_identities_are_not_blamed(name, abreast):
    for seed in range(2):
        assert odd(name, *crossing(seed, abreast=abreast)) == []
        assert odd(name, *crossing(seed, abreast=abreast), identity=IdentityParameters()) == []


@pytest.mark.parametrize("name", ["multi-sensor", "mht"])
def test_a_wrong_one_is_found_there(name):
    for seed in range(2):
        lines = odd(name, *crossing(seed, wrong=C))
        assert [("4b1a22 became 400001" in line) for line in lines] == [True]
        lines = odd(name, *crossing(seed, wrong=C), identity=IdentityParameters())
        assert len(lines) == 1 and "goes on as" in lines[0] and "4b1a22 became 400001" in lines[0]
        assert any("3c6444 is that of tracks" in line for line in odd(name, *crossing(seed, wrong=A)))


def test_live_tells_them(ships, tmp_path, monkeypatch, capsys):
    scene, names = ships
    scene.save(tmp_path / "ships.npz")
    lines = []
    for k, known in enumerate(names):
        for s, (z, pairs) in enumerate(zip(scene.measurements[k], known, strict=True)):
            for i, ((x, y), (_, number)) in enumerate(zip(z.tolist(), pairs.tolist(), strict=True)):
                lines.append(f"{s + 1},{float(scene.times[k]) + 0.01 * i!r},{x!r},{y!r},,{number or ''}")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO("\n".join(lines).encode())))
    given = [str(tmp_path / "ships.npz"), "--targets", "ship", "--interval", "3", "-o", str(tmp_path / "out.csv")]
    assert live.main(given) == 0
    said = capsys.readouterr().err
    assert said.count("211000002 became 211000009 (AIS)") == said.count("address 211000001 is that of tracks") == 1
    assert "2 odd identities" in said
