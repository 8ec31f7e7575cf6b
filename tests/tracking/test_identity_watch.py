"""Wrong identities are told by name, once; garbled ones, changes of tracks and of codes are not."""

import io
import sys

import numpy as np
import pytest

from assoc import live
from assoc.scene import Scene
from assoc.sensors import PositionSensor
from assoc.tracking import TRACKERS
from assoc.tracking.adapting.identity_watch import MOST, IdentityWatch

A, B, C = 0x3C6444, 0x4B1A22, 0x400001


def sensor(name):
    return PositionSensor(
        name=name, position=[0.0, 0.0, 0.0], noise=[10.0, 10.0], detection_probability=0.95, false_alarm_rate=0.01,
        field_of_view=[[-2e4, 2e4], [-2e4, 2e4]],
    )  # fmt: skip


SENSORS = [sensor("radar"), sensor("AIS")]


def told(*plots, decimal=False, living=(), column=1):
    """What is found of plots (time, sensor, track, number), one in each step."""
    watch = IdentityWatch(SENSORS, decimal=decimal)
    for time, s, track, number in plots:
        pairs = [np.zeros((0, 2), dtype=np.int64)] * 2
        pairs[s] = np.zeros((1, 2), dtype=np.int64)
        pairs[s][0, column] = number
        taken = [np.full(len(pair), track) for pair in pairs]
        watch.take(time, taken, [ids > 0 for ids in taken], None, pairs, lambda: living)
    return [str(odd) for odd in watch.found]


def every(begin, end, *rest, step=1.0):
    return [(float(time), *rest) for time in np.arange(begin, end, step)]


def test_an_address_that_changes():
    plots = [*every(0, 10, 1, 7, A), *every(10, 20, 1, 7, B)]
    assert told(*plots) == ["track 7: address 3c6444 became 4b1a22 (AIS), 12 s"]
    # once, whatever comes after; single garbled ones are nothing
    assert len(told(*plots, (20, 1, 7, A), (21, 1, 7, B), (22, 1, 7, C), (23, 1, 7, C), *every(24, 30, 1, 7, B))) == 1
    # a code may change in flight
    assert told(*plots, column=0) == []


def test_two_sensors_that_disagree():
    plots = sorted([*every(0, 60, 0, 7, A), *every(0.5, 60, 1, 7, B, step=10.0)])
    assert told(*plots) == ["track 7: address 4b1a22 by AIS, 3c6444 by radar, 30.5 s"]
    # a new code is first said by one radar and then by the other
    change = sorted([*every(0, 20, 0, 7, 0o21), *every(0.5, 18, 1, 7, 0o21, step=4.0), *every(20, 40, 0, 7, 0o22),
                     *every(20.5, 40, 1, 7, 0o22, step=4.0)])  # fmt: skip
    assert told(*change, column=0) == []


def test_one_address_on_two_tracks():
    both = sorted([*every(0, 10, 1, 7, A), *every(0.5, 10, 1, 9, A)])
    assert told(*both) == ["address 3c6444 is that of tracks 7 and 9 at once (AIS), 4 s"]
    assert told(*both, decimal=True, column=1) == told(*both)
    # a track that ends and another that goes on are one aircraft, also if the old one takes a plot once more
    after = [*every(0, 10, 1, 7, A), *every(10, 20, 1, 9, A), (20, 1, 7, A), *every(21, 30, 1, 9, A)]
    assert told(*after) == []
    # codes that end in 00 are of many, others of one
    for base, decimal in ((8, False), (10, True)):
        some = sorted([*every(0, 10, 0, 7, 2 * base**3), *every(0.5, 10, 0, 9, 2 * base**3)])
        one = [(time, s, track, number + 1) for time, s, track, number in some]
        assert told(*some, decimal=decimal, column=0) == []
        assert told(*one, decimal=decimal, column=0) == ["code 2001 is that of tracks 7 and 9 at once (radar), 4 s"]
    ships = [(time, s, track, 211234567) for time, s, track, _ in both]
    assert told(*ships) == ["address 211234567 is that of tracks 7 and 9 at once (AIS), 4 s"]


def test_mixed_plots_are_told_as_one_address_on_two_tracks():
    plots = sorted([*every(0, 40, 0, 7, A), *every(0.5, 40, 1, 7, B), *every(0.2, 40, 0, 9, B)])
    assert all("at once" in line for line in told(*plots))


def test_after_a_new_beginning_earlier_times_are_watched():
    watch, pairs = IdentityWatch(SENSORS[1:]), np.array([[[0, A]], [[0, B]]])
    for begin in (1000.0, 0.0):
        for k in range(10):
            watch.take(begin + k, [np.array([7])], [np.ones(1, dtype=bool)], None, [pairs[k // 5]], lambda: ())
        assert len(watch.found) == 1
        watch.found.clear()
        watch.begin_anew()
        watch._known.clear()


def test_memory_is_bounded():
    watch, pairs = IdentityWatch([SENSORS[1]]), np.zeros((2, 2), dtype=np.int64)
    for k in range(6 * MOST):
        pairs[:, 1] = 1 + k // 3
        watch.take(float(k), [np.array([1, 2 + k])], [np.ones(2, dtype=bool)], None, [pairs], lambda: ())
    assert len(watch.found) == MOST and len(watch._voices) < 400 and len(watch._owners) < 400


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
        f"track {other}: address 211000009 became 211000001 (AIS)",
        f"address 211000001 is that of tracks {one} and {two} at once (AIS)",
    ]
    assert str(tracker.health).splitlines()[-3:] == [str(odd) for odd in tracker.health.identities]


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
    assert said.count("211000002 became 211000009 (AIS)") == said.count("211000009 became 211000001 (AIS)") == 1
    assert said.count("address 211000001 is that of tracks") == 1 and "3 odd identities" in said
