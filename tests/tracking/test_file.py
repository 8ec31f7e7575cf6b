"""A file that is no saved tracker is refused by one line, whatever is wrong with it; the tracker stays as it was."""

import numpy as np
import pytest

from assoc import simulation
from assoc._files.npz import save_npz
from assoc.errors import InvalidInputError
from assoc.tracking import TRACKERS
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from tests.sizes import sample
from tests.tracking.stepping import stepped

SCENE = simulation.simulate("three-radar", 4, scans=7)
SCANS = 5


def saved(kind, path, filter_=None):
    tracker = kind.for_scene(SCENE, filter_)
    stepped(tracker, SCENE, 0, SCANS)
    tracker.save(path)
    return tracker


def arrays_of(tracker):
    return file_arrays(tracker.settings, tracker.state)


def step(tracker):
    return stepped(tracker, SCENE, SCANS, SCANS + 1)[0]


def nan_time(a):
    a["time"] = np.array(np.nan)


LIES = {
    "time": nan_time,
    "scan": lambda a: a.update(scan=np.array(-1)),
    "pace": lambda a: a.update(pace=np.array(np.inf)),
    "next_id": lambda a: a.update(next_id=np.array(0)),
    "tracks.score": lambda a: a["tracks.score"].__setitem__(0, np.nan),
    "tracks.hits": lambda a: a.update({"tracks.hits": a["tracks.hits"][:-1]}),
    "tracks.missed": lambda a: a["tracks.missed"].__setitem__(0, -3),
    "tracks.track_id": lambda a: a["tracks.track_id"].__setitem__(0, 0),
    "tracks.state.weights": lambda a: a["tracks.state.weights"].__setitem__(0, [-1.0, 2.0]),
    "tracks.state.means": lambda a: a.update({"tracks.state.means": a["tracks.state.means"][:, :, :3]}),
    "tracks.state.covariances": lambda a: a["tracks.state.covariances"].__setitem__(0, np.inf),
}
OF_MHT = {
    "history": lambda a: a["history"].__setitem__((0, 0), 999),
    "window_sizes": lambda a: a["window_sizes"].__setitem__((0, 0), 10**15),
    "window_times": lambda a: a.update(window_times=np.zeros(9), window_sizes=np.zeros((9, 3), dtype=int)),
}
OF_TREES = {
    "born": lambda a: a["born"].__setitem__(0, 99),
    "chosen": lambda a: a.update(chosen=a["chosen"][1:]),
    "tracks.track_id": lambda a: a.update({"tracks.track_id": a["tracks.track_id"][::-1].copy()}),
}
OF_HYPOTHESES = {
    "cluster_hypotheses": lambda a: a["cluster_hypotheses"].__setitem__(0, 0),
    "cluster_branches": lambda a: a["cluster_branches"].__setitem__(0, 10_000),
    "holds": lambda a: a.update(holds=a["holds"][1:]),
    "weight": lambda a: a["weight"].__setitem__(0, np.nan),
}


@sample(
    "name, lies",
    [
        *((name, LIES) for name in sorted(TRACKERS)),
        ("mht", OF_MHT),
        ("mht-hypothesis", OF_MHT),
        ("mht", OF_TREES),
        ("mht-hypothesis", OF_HYPOTHESES),
    ],
    every=3,
)
def test_each_lie_is_named(name, lies, tmp_path):
    tracker, path = saved(TRACKERS[name], tmp_path / "good.npz"), tmp_path / "bad.npz"
    for field, lie in lies.items():
        arrays = {key: np.array(value) for key, value in arrays_of(tracker).items()}
        lie(arrays)
        save_npz(path, FORMAT, VERSION, arrays)
        again = TRACKERS[name].for_scene(SCENE)
        with pytest.raises(InvalidInputError) as caught:
            again.restore(path)
        assert str(caught.value).startswith(f"{path}: ") and f"'{field}'" in str(caught.value)
        assert again.time is None


@pytest.mark.parametrize("field", ["estimates.dwells", "estimates.used", "biases.used"])
def test_numbers_too_large_for_any_estimate_are_named(field, tmp_path):
    tracker = TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True)
    step(tracker)
    arrays = {key: np.array(value) for key, value in arrays_of(tracker).items()}
    arrays[field][...] = 1e308
    save_npz(tmp_path / "bad.npz", FORMAT, VERSION, arrays)
    with pytest.raises(InvalidInputError, match=f"'{field}'.*below 1e\\+30"):
        TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True).restore(tmp_path / "bad.npz")


@pytest.mark.parametrize(("field", "lie"), [("hits", 1e3), ("open_hits", 1e3), ("alarms", -1e3), ("turns", -1e3)])
def test_counts_that_cannot_be_are_named(field, lie, tmp_path):
    """A rate of a negative number, or of more hits than dwells, has no standard deviation."""
    tracker = TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True)
    stepped(tracker, SCENE, 0, SCANS)
    arrays = {key: np.array(value) for key, value in arrays_of(tracker).items()}
    assert arrays[f"estimates.{field}"].size
    arrays[f"estimates.{field}"] += lie
    save_npz(tmp_path / "bad.npz", FORMAT, VERSION, arrays)
    with pytest.raises(InvalidInputError, match=f"'estimates.{field}'.*expected (no )?number"):
        TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True).restore(tmp_path / "bad.npz")


@pytest.mark.parametrize("field", ["estimates.ids", "unresolved.confirmed", "echoes.hidden"])
def test_ids_that_do_not_ascend_are_named(field, tmp_path):
    """They are searched for by halving."""
    tracker = TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True)
    stepped(tracker, SCENE, 0, SCANS)
    arrays = {key: np.array(value) for key, value in arrays_of(tracker).items()}
    ids = arrays[field] if len(arrays[field]) > 1 else np.array([1, 2])
    save_npz(tmp_path / "good.npz", FORMAT, VERSION, {**arrays, field: ids})
    TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True).restore(tmp_path / "good.npz")
    save_npz(tmp_path / "bad.npz", FORMAT, VERSION, {**arrays, field: ids[::-1].copy()})
    with pytest.raises(InvalidInputError, match=f"'{field}'.*expected ids that ascend"):
        TRACKERS["multi-sensor"].for_scene(SCENE, adapt=True).restore(tmp_path / "bad.npz")


@pytest.mark.parametrize("settings", ["{", "[]", "[" * 5000, '{"seed": "1"}'])
def test_settings_that_cannot_be_read(settings, tmp_path):
    kind, path = TRACKERS["multi-sensor"], tmp_path / "bad.npz"
    tracker = saved(kind, path)
    save_npz(path, FORMAT, VERSION, arrays_of(tracker) | {"settings": np.array(settings)})
    with pytest.raises(InvalidInputError, match="was saved by a tracker with other settings"):
        kind.for_scene(SCENE).restore(path)
