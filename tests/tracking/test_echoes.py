"""Tracks that are echoes of others, beside scenes in which what is an echo is known."""

import numpy as np
import pytest

from assoc._files.npz import save_npz
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.sensors import Radar3D
from assoc.tracking import TRACKERS
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from assoc.tracking.records.echoes import AZIMUTH, RANGE, Echoes
from tests.sizes import sample
from tests.tracking.stepping import stepped

NOISE = np.array([25.0, 3e-3, 4e-3])
RADAR = Radar3D(
    position=[0.0, 0.0, 50.0], noise=NOISE, detection_probability=0.9, false_alarm_rate=5.0,
    field_of_view=[[0.0, 45e3], [-np.pi, np.pi], [-0.05, 1.4]], name="coast",
)  # fmt: skip
SCANS, PACE = 50, 2.5


def flights(rng, count=6):
    """Ranges, azimuths and elevations of flights straight to the radar or from it, (count, SCANS, 3)."""
    t = PACE * (np.arange(SCANS) - SCANS / 2)
    r = rng.uniform(12e3, 28e3, (count, 1)) + rng.uniform(80.0, 160.0, (count, 1)) * t
    azimuth = (np.arange(count) / count * 2.0 * np.pi - np.pi + rng.uniform(0.0, 0.3, count))[:, None] + 0.0 * t
    return np.stack([r, azimuth, 2e3 / r], axis=-1)


def scene_of(paths, rng, echo=None, share=0.4):
    """Plots of targets; with a share of them another one, displaced by `echo` (range, azimuth, elevation)."""
    scans = []
    for k in range(SCANS):
        z = paths[rng.random(len(paths)) < 0.9, k]
        parts = [z] if echo is None else [z, z[rng.random(len(z)) < share] + echo]
        z = np.concatenate(parts) + NOISE * rng.normal(size=(sum(map(len, parts)), 3))
        false = rng.uniform(*RADAR.field_of_view.T, (rng.poisson(5.0), 3))
        z = np.concatenate([z, false])
        z[:, 1] = (z[:, 1] + np.pi) % (2.0 * np.pi) - np.pi
        scans.append([z])
    region = [[-45e3, 45e3], [-45e3, 45e3], [0.0, 12e3]]
    return Scene([RADAR], PACE * np.arange(SCANS), scans, region)


def reported(scene, name="multi-sensor"):
    """A tracker that adapts, after a scene; how many tracks it showed and hid in each of the later scans."""
    tracker, shown, hidden = TRACKERS[name].for_scene(scene, adapt=True), [], []
    for k in range(scene.num_scans):
        step = stepped(tracker, scene, k, k + 1)[0]
        gone = tracker.state.echoes.hidden
        assert not np.isin(step.assigned[0][step.confirmed[0]], gone).any()
        shown.append(sum(track.reported for track in tracker.tracks))
        hidden.append(len(gone))
    return tracker, np.array(shown), np.array(hidden)


@pytest.mark.parametrize(
    ("name", "kind"), [("multi-sensor", AZIMUTH), ("mht", RANGE), ("joint-probabilistic", AZIMUTH)]
)
def test_echoes_are_found_and_not_shown(name, kind, monkeypatch):
    rng = np.random.default_rng(1)
    echo = [200.0, 0.0, -0.01] if kind == AZIMUTH else [0.0, 0.07, 0.0]
    scene = scene_of(flights(rng), rng, echo)
    tracker, shown, hidden = reported(scene, name)
    assert shown[25:].mean() < 6.8
    assert hidden[25:].mean() > 2.0
    ghosts = tracker.health.sensors[0].ghosts
    assert ghosts[kind] >= 5 and ghosts[1 - kind] <= 1
    assert f"ghosts: {ghosts[0]} tracks by side lobes, {ghosts[1]} by multipath" in str(tracker.health)
    monkeypatch.setattr("assoc.tracking.step.hide_echoes", lambda progress: progress)
    assert reported(scene, name)[1][25:].mean() > 8.5


@sample("name", ["multi-sensor", "mht"], every=2)
def test_short_echoes_are_more_than_chance_brings(name):
    """Also where a tracker knows of a track by its second plot alone; without echoes there are as many as by chance."""
    counted = []
    for echo in ([0.0, 0.07, 0.0], None):
        known = []
        for seed in range(3):
            rng = np.random.default_rng(seed)
            known.append(reported(scene_of(flights(rng), rng, echo, share=0.25), name)[0].state.echoes)
        short, chance = (sum(getattr(each, what)[0, RANGE] for each in known) for what in ("short", "expected"))
        counted.append((short - chance, np.sqrt(chance)))
    assert counted[0][0] > 20.0 and abs(counted[1][0]) < 3.0 * counted[1][1] + 1.0


@pytest.mark.parametrize("gap", [[0.0, 0.07, 0.0], [600.0, 0.0, 0.0], [2000.0, 0.0, 0.0]])
@pytest.mark.parametrize("seed", [1, 2])
def test_targets_abreast_and_in_trail_are_shown(gap, seed):
    rng = np.random.default_rng(seed)
    leaders = flights(rng, 3)
    tracker, shown, hidden = reported(scene_of(np.concatenate([leaders, leaders + gap]), rng))
    assert not hidden.any()
    assert shown[20:].mean() > 5.6
    assert tracker.health.sensors[0].ghosts == (0, 0)


def test_an_echo_that_goes_on_without_the_target_is_a_target():
    rng = np.random.default_rng(3)
    pair = Echoes.none(1)._replace(ids=np.array([[2, 1]]), kinds=np.array([[0, RANGE]]))

    def odds(hits, misses, strays, square, seen=0.9):
        counts = np.array([[hits, misses, strays, square, 0.01, 1.0]], dtype=float)
        return pair._replace(counts=counts).log_odds(np.array([seen]))[0]

    seldom = odds(8, 12, 0, 8.0)
    assert seldom > 2.0
    assert odds(18, 2, 0, 18.0) < -1.5
    assert odds(8, 12, 3, 8.0) < seldom - 6.0
    # also where the sensor hardly sees: others have detected it
    assert odds(1, 0, 20, 1.0, seen=0.01) < -20.0
    # squared differences of one that flies elsewhere grow
    assert odds(8, 12, 0, np.sum(np.arange(8.0) ** 2) + rng.chisquare(8)) < -20.0


def test_a_saved_tracker_remembers_echoes(tmp_path):
    rng = np.random.default_rng(1)
    scene = scene_of(flights(rng), rng, [200.0, 0.0, -0.01])
    one, other = (TRACKERS["multi-sensor"].for_scene(scene, adapt=True) for _ in range(2))
    stepped(one, scene, 0, 30)
    one.save(tmp_path / "a.npz")
    other.restore(tmp_path / "a.npz")
    assert len(other.state.echoes.ids)
    stepped(one, scene, 30)
    stepped(other, scene, 30)
    for ours, theirs in zip(one.state.echoes, other.state.echoes, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    arrays = file_arrays(one.settings, one.state)
    for field, value in (("counts", arrays["echoes.counts"] * np.nan), ("kinds", arrays["echoes.kinds"] + 1)):
        save_npz(tmp_path / "b.npz", FORMAT, VERSION, arrays | {f"echoes.{field}": value})
        with pytest.raises(InvalidInputError, match=f"echoes.{field}"):
            other.restore(tmp_path / "b.npz")
