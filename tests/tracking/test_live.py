"""Plots one by one: the tracks of a scene, and what comes of clocks that jump, silence, repetition, strangers."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from assoc._cli.track.plot_lines import replayed
from assoc.errors import InvalidInputError
from assoc.recordings import Window
from assoc.scene import Scene
from assoc.sensors import Platform, Radar3D
from assoc.simulation import observe, simulate
from assoc.tracking import TRACKERS, IdentityParameters, LiveTracker
from assoc.tracking.live.kept_identities import KeptIdentities
from assoc.tracking.offline.plots import track_plots
from tests.sizes import sample
from tests.tracking.crossing import TURN, crossing, radar

TURNS = [4.0, 5.0, 5.5]


@pytest.fixture(scope="module")
def scene():
    return simulate("rotating-radars", 4, aircraft=4, duration=40.0, false_alarms=1.0)


def live(scene, **options):
    told = []
    made = LiveTracker(
        scene,
        lambda: TRACKERS["nearest-neighbour"].for_scene(scene),
        **({"turns": TURNS, "tell": told.append} | options),
    )
    return made, told


def fed(tracker, plots):
    pictures = []
    for plot in plots:
        pictures += tracker.take(*plot)
    return pictures + tracker.finish()


def found(pictures, scene):
    """Distance of each target at the end from the nearest track."""
    last = pictures[-1]
    ahead = float(scene.times[-1]) - last.time
    places = np.array([track.position + ahead * track.velocity for track in last.tracks]).reshape(-1, 3)
    truth = scene.truth.positions[-1]
    assert last.time == pytest.approx(scene.times[-1], abs=1.5)
    return [float(np.linalg.norm(places - one, axis=1).min()) for one in truth]


def test_tracks_of_a_stream_are_those_of_the_scene(scene):
    tracker, told = live(scene)
    pictures = fed(tracker, replayed(scene, 0.0))
    assert max(found(pictures, scene)) < 300.0
    assert len(pictures[-1].tracks) == 4 and not told
    assert [one.time for one in pictures] == list(map(float, range(1, len(pictures) + 1)))
    plots = sum(len(one.plots) for one in pictures)
    assert plots == sum(len(z) for scan in scene.measurements for z in scan) == tracker.counts["plots"]
    assert "p99" in tracker.summary() and len(tracker.seconds) == len(pictures) >= 39


def test_what_is_wrong_is_told_once_and_the_tracker_goes_on(scene):
    tracker, told = live(scene)
    plots = []
    for k, plot in enumerate(replayed(scene, 0.0)):
        plots.append(plot)
        if k % 10 == 5:
            plots += [
                plot,  # repeated
                plot._replace(sensor="nobody"),
                plot._replace(values=plot.values[:1]),
                plot._replace(values=[math.nan] * 3),
                plot._replace(values=[-5e4, 0.0, 0.0]),
                plot._replace(time=math.inf),
                plot._replace(time=plot.time + 5_000.0),  # a clock ahead of all others
                plot._replace(time=plot.time - 5_000.0),  # and one behind
            ]
    pictures = fed(tracker, plots)
    assert max(found(pictures, scene)) < 300.0 and len(pictures[-1].tracks) == 4
    kinds = ["unknown sensor 'nobody'", "repeats a plot", "left out: measurements of sensor", "ahead of all others"]
    for words in [*kinds, "more than 30 s late"]:
        assert sum(words in line for line in told) == 1, (words, told)
    assert all("\n" not in line for line in told) and len(told) == 5
    rounds = tracker.counts["repeated"]
    assert rounds > 10
    assert tracker.counts["unknown sensor"] == tracker.counts["ahead"] == tracker.counts["too old"] == rounds
    assert tracker.counts["unusable"] == 4 * rounds


@pytest.mark.parametrize("turns", [TURNS, None])
def test_a_plot_comes_again_over_another_line(scene, turns):
    """Some ms later it is the same plot, if the antenna turns; a sensor that does not may measure the same again."""
    plots = list(replayed(scene, 0.0))
    again = [plot._replace(time=plot.time + 0.02) for plot in plots[::3]]
    tracker, told = live(scene, turns=turns)
    pictures = fed(tracker, sorted([*plots, *again], key=lambda plot: plot.time))
    assert tracker.counts["repeated"] == (len(again) if turns else 0)
    assert tracker.counts["plots"] == len(plots) + (0 if turns else len(again))
    assert len(told) == (1 if turns else 0) and all("20 ms from it: left out" in line for line in told)
    if turns:
        assert max(found(pictures, scene)) < 300.0 and len(pictures[-1].tracks) == 4


def test_late_plots_are_put_in_their_place(scene):
    rng = np.random.default_rng(0)
    plots = list(replayed(scene, 0.0))
    delay = rng.uniform(0, 10, len(plots)) * (rng.random(len(plots)) < 0.2)
    order = np.argsort([plot.time + d for plot, d in zip(plots, delay, strict=True)])
    tracker, told = live(scene)
    pictures = fed(tracker, [plots[k] for k in order])
    assert max(found(pictures, scene)) < 300.0
    assert tracker.counts["late"] > 20 and not told and tracker.counts["plots"] == len(plots)
    # with patience for them none is late
    patient, _ = live(scene, wait=11.0)
    pictures = fed(patient, [plots[k] for k in order])
    assert patient.counts["late"] == 0
    # nor is any lost for which an interval still waits when the plots end
    assert sum(len(one.plots) for one in pictures) == len(plots)


def test_a_clock_that_jumps_for_all_is_believed(scene):
    plots = list(replayed(scene, 0.0))
    half = len(plots) // 2
    for jump, words in ((7_200.0, "the clock jumped from"), (-7_200.0, "the clock went back from")):
        tracker, told = live(scene)
        moved = [plot._replace(time=plot.time + jump) for plot in plots[half:]]
        pictures = fed(tracker, plots[:half] + moved)
        assert sum(words in line for line in told) == 1
        # no plot is lost that still waited
        assert sum(len(one.plots) for one in pictures) == tracker.counts["plots"]
        assert pictures[-1].time == pytest.approx(scene.times[-1] + jump, abs=1.5)
        assert len(pictures[-1].tracks) >= 3
        # tracks begin anew, with ids that were not used before
        before = {t.track_id for one in pictures if abs(one.time) < 1_000 for t in one.tracks}
        after = {t.track_id for one in pictures if abs(one.time) > 1_000 for t in one.tracks}
        assert before and after and max(before) < min(after)


def test_seconds_of_the_day_go_on_over_midnight(scene):
    """Tracks and their ids stay, late plots and own repeats too; an hour that is wrong is no midnight."""
    plots = [plot._replace(time=plot.time + 86_380.0) for plot in replayed(scene, 0.0)]
    of_day = [plot._replace(time=plot.time % 86_400.0) for plot in plots]
    (whole, told), (days, told_of_day) = live(scene), live(scene)
    expected, found = fed(whole, plots), fed(days, [*of_day, of_day[-1], of_day[-1]._replace(time=43_200.0)])
    assert [one.time for one in found] == [one.time for one in expected] and found[-1].time > 86_400.0
    ids = [[track.track_id for track in one.tracks] for one in (found[-1], expected[-1])]
    assert ids[0] == ids[1] and len(ids[0]) == 4
    assert days.counts["repeated"] == 1 and days.counts["too old"] + days.counts["ahead"] == 1
    assert not told and len(told_of_day) == 2


def test_the_silence_of_a_radar_is_no_miss(scene):
    plots = [plot for plot in replayed(scene, 0.0) if plot.sensor != "2" or plot.time < 10.0 or plot.time > 30.0]
    tracker, told = live(scene)
    pictures = fed(tracker, plots)
    assert len(pictures[-1].tracks) == 4
    name = scene.sensors[1].name
    assert [line.split(" ")[0:4] for line in told] == [
        [*name.split(), "has", "sent"],
        [*name.split(), "is", "back"],
    ]


def test_what_is_refused(scene):
    for options, words in [
        ({"turns": [4.0]}, "turns: expected one for each of 3 sensors"),
        ({"turns": [4.0, 5.0, 0.5]}, "turns: must not be shorter than the interval"),
        ({"interval": 0.0}, "interval"),
        ({"interval": 1e-9}, "interval: expected at least 0.001 s"),
        ({"horizon": -1.0}, "horizon"),
    ]:
        with pytest.raises(InvalidInputError, match=words):
            live(scene, **options)


def partition(tracks):
    """Tracks by the order in which they first took a plot."""
    number = {0: 0, -1: 0}
    return [number.setdefault(one, len(number) - 1) for one in tracks]


@sample("name", ["mht", "nearest-neighbour", "joint-probabilistic"], every=3)
def test_identities_give_the_tracks_of_the_recording(name):
    recording = crossing(2, begin=1.0)
    number = np.floor(recording.times / TURN)
    windows = [Window.of(recording, np.flatnonzero(number == k), k) for k in np.unique(number)]
    told = np.stack([recording.identities, recording.addresses], axis=1)
    everywhere = np.array([[0.0, 2.0 * np.pi]])
    found = {}
    for how, identity in (("use", IdentityParameters()), ("ignore", None)):
        plain, online, stored = (TRACKERS[name]([radar(recording)], identity=identity) for _ in range(3))
        expected = []
        for k, window in enumerate(windows):
            rows = window.rows
            step = plain.step(
                TURN * (k + 1), [recording.measurements[rows]], [recording.times[rows]], everywhere, [told[rows]]
            )
            expected += step.assigned[0].tolist()
        place = Scene(sensors=[radar(recording)], times=[0.0], measurements=[[np.zeros((0, 2))]])
        live, taken = LiveTracker(place, lambda made=online: made, interval=TURN, tell=pytest.fail), []
        step_of = online.step

        def noted(*given, step_of=step_of, taken=taken):
            step = step_of(*given)
            taken += step.assigned[0].tolist()
            return step

        online.step = noted
        for time, z, pair in zip(recording.times.tolist(), recording.measurements.tolist(), told.tolist(), strict=True):
            live.take("1", time, z, tuple(pair))
        last = live.finish()[-1]
        assert taken == expected
        sure = [track for track in plain.tracks if track.confirmed]
        np.testing.assert_array_equal([one.mean for one in last.tracks], [one.mean for one in sure])
        # the program's own way through a recording ends its windows elsewhere: new tracks are confirmed a little sooner
        done = track_plots(stored, recording, windows)
        kept, known = done.kept
        assert partition(taken[20:]) == partition(done.tracks[20:])
        assert known == 2 and f"{kept} of 2 tracks with an identity kept one" in live.summary()
        assert ("were used" in live.summary()) == (how == "use")
        found[how] = partition(taken)
    assert found["use"] != found["ignore"] and set(found["use"][20:]) == {1, 2}


def pictured(pictures):
    """Pictures as plain values."""
    return [
        (
            one.time,
            one.ended,
            [(t.track_id, t.time, t.hits, t.mean.tolist(), t.covariance.tolist()) for t in one.tracks],
        )
        for one in pictures
    ]


@sample("name", ["mht", "nearest-neighbour", "multi-sensor"], every=3)
@sample("again", [15, 0], every=2)
def test_a_saved_tracker_goes_on_as_if_nothing_had_happened(scene, tmp_path, name, again):
    """Whether the source goes on where it was, or repeats its last plots, which are known; plots come late, too."""
    identity = IdentityParameters() if name == "mht" else None
    options = {
        "make": lambda: TRACKERS[name].for_scene(scene, identity=identity),
        "tell": [].append, "turns": TURNS, "horizon": 8.0,
    }  # fmt: skip
    plots = [(sensor, time, values, (k % 7, 0)) for k, (sensor, time, values, _) in enumerate(replayed(scene, 0.0))]
    plots = [plots[k] for k in np.argsort([time + 3.0 * (k % 5 == 0) for k, (_, time, *_) in enumerate(plots)])]
    half = len(plots) // 2
    whole, first = LiveTracker(scene, **options), LiveTracker(scene, **options)
    early = [picture for plot in plots[:half] for picture in whole.take(*plot)]
    for plot in plots[:half]:
        first.take(*plot)
    first.save(tmp_path / "live.npz")
    second = LiveTracker(scene, **options)
    second.restore(tmp_path / "live.npz")
    assert early[-1].tracks and whole.counts["late"] > 0
    rest = [picture for plot in plots[half:] for picture in whole.take(*plot)] + whole.finish()
    assert pictured(fed(second, plots[half - again :])) == pictured(rest)
    assert second.counts - Counter(repeated=again) == whole.counts


def test_a_saved_state_is_checked(scene, tmp_path):
    tracker, _ = live(scene)
    for plot in [*replayed(scene, 0.0)][:80]:
        tracker.take(*plot)
    tracker.save(tmp_path / "live.npz", reserve=100)
    other, _ = live(scene)
    other.restore(tmp_path / "live.npz")
    assert other.state.tracker.next_id == tracker.state.tracker.next_id + 100
    for options, message in [
        ({"interval": 0.5}, "live.npz: was saved with interval 1.0, .* not interval 0.5"),
        ({"make": lambda: TRACKERS["mht"].for_scene(scene)}, "other settings: tracker was 'nearest-neighbour'"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            LiveTracker(scene, **({"make": tracker.settings.make, "turns": TURNS} | options)).restore(
                tmp_path / "live.npz"
            )


def at_sea():
    """A radar on a ship that turns, and its scene; the tracker's scene knows where the ship was at the start alone."""
    times = np.arange(0.0, 41.0)
    heading = 0.3 + 0.03 * times
    way = np.cumsum(15.0 * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1), axis=0)
    ship = Platform(times, way, heading)
    view = [[0, 2e4], [-np.pi, np.pi], [-0.2, 1.5]]
    on_board = Radar3D(
        position=[5, 0, 15], noise=[20, 2e-3, 2e-3], field_of_view=view, name="ship", platform=ship,
        detection_probability=0.95, false_alarm_rate=0.5,
    )  # fmt: skip
    places = np.array([[6e3, 2e3, 800.0], [-5e3, 4e3, 1500.0], [2e3, -7e3, 400.0]])
    velocities = np.array([[-120.0, 40, 0], [90.0, 60, 0], [20.0, 140, 0]])
    region = np.array([[-1.5e4, 1.5e4], [-1.5e4, 1.5e4], [0, 3e3]])
    scans = np.arange(2.0, 40.0, 2.0)
    paths = [places + t * velocities for t in scans]
    scene = observe([on_board], scans, [np.arange(3)] * len(scans), paths, np.random.default_rng(2), region=region)
    start = Platform(times[:1], way[:1], heading[:1])
    return scene, replace(scene, sensors=[replace(on_board, platform=start)], times=scans - scans[0], truth=None), ship


def own_positions(ship, until=math.inf):
    rows = zip(ship.times.tolist(), ship.positions.tolist(), ship.headings.tolist(), strict=True)
    return [row for row in rows if row[0] <= until]


def test_own_positions_of_a_ship(tmp_path):
    """Tracks are those of a tracker that knew the ship's way before, also after a restart; a stale position goes on."""
    scene, told_scene, ship = at_sea()
    known, _ = live(scene, turns=None)
    there = fed(known, replayed(scene, 0.0))[-1]
    assert max(found([there], scene)) < 60.0

    def streamed(tracker, plots, messages):
        pictures, messages = [], list(messages)
        for plot in plots:
            while messages and messages[0][0] <= plot.time + 1.0:
                tracker.take_own_position("ship", *messages.pop(0))
            pictures += tracker.take(*plot)
        return pictures

    plots = list(replayed(scene, 0.0))
    half = len(plots) // 2
    first, told = live(told_scene, turns=None)
    streamed(first, plots[:half], own_positions(ship))
    first.save(tmp_path / "live.npz")
    second, _ = live(told_scene, turns=None)
    second.restore(tmp_path / "live.npz")
    streamed(second, plots[half:], own_positions(ship))
    last = second.finish()[-1]
    assert told == []
    for a, b in zip(last.tracks, there.tracks, strict=True):
        np.testing.assert_allclose(a.position, b.position, atol=1e-6)
    np.testing.assert_allclose(last.plots, there.plots, atol=1e-6)
    # four seconds old at the end
    late, told = live(told_scene, turns=None)
    streamed(late, plots, own_positions(ship, 34.0))
    assert max(found([late.finish()[-1]], scene)) < 100.0 and told == []
    # none at all: the ship stands where the scene has it; or only at first
    for until in (-1.0, 3.0):
        late, told = live(told_scene, turns=None)
        streamed(late, plots, own_positions(ship, until))
        late.finish()
        silent = ["ship has had no own position since 3 s: it goes on as then"] if until > 0 else []
        assert told == silent and late.counts["steps failed"] == 0


def test_tracks_are_called_by_their_codes():
    """By the majority of their last plots: the code where there is one, else the address or a ship's number."""
    kept = KeptIdentities()
    known = np.array([[4521, 0x3C6444], [4521, 0x3C6444], [1000, 0x3C6444], [0, 0x3C6444], [0, 235_000_100], [0, 0]])
    tracks = np.array([1, 1, 1, 2, 3, 4])
    kept.take(tracks, np.ones(6, dtype=bool), np.arange(6.0), known)
    assert [kept.name_of(track) for track in (1, 2, 3, 4, 5)] == ["4521", "3c6444", "235000100", "", ""]
