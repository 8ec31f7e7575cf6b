"""Everything in the package and the experiments that writes a file, as functions of its path.

python -m tests.reliability.writers FOLDER      tries each in FOLDER; prints what it said and what is there then
"""

import json
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

import assoc
from assoc.errors import InvalidInputError

Writer = Callable[[Path], object]


def writers() -> Mapping[str, Writer]:
    """Return the functions; what they write is a kilobyte at the least, and made before."""
    from assoc.plotting.report import write_association_report, write_tracking_report
    from assoc.plotting.study_figures import new_figure, save_figure
    from assoc.recordings import write_plots, write_tracks
    from assoc.simulation import simulate, simulate_recording
    from assoc.tracking import MultiSensorTracker, track_scene

    scene = simulate("three-radar", 2, scans=6)
    recording = simulate_recording("rotating-radar", 1, duration=60.0)
    truth = recording.truth
    rng = np.random.default_rng(0)
    tuples = np.unique(rng.integers(0, 9, (300, 3)) + 1, axis=0)
    problem = assoc.AssignmentProblem(tuples, rng.normal(size=len(tuples)), [9, 9, 9])
    found = assoc.associate(scene, "greedy")
    tracker = MultiSensorTracker(scene.sensors, region=scene.region)
    table, _ = track_scene(tracker, scene, confirmed=False)
    sources = [scene] * scene.num_scans
    return {
        "scene": scene.save,
        "problem": problem.save,
        "tracker": tracker.save,
        "association": found.to_json,
        "tracks": table.to_csv,
        "plots of a radar": lambda path: write_plots(path, recording.recording),
        "truth": lambda path: write_tracks(path, truth.ids, truth.times, truth.positions, recording.velocities),
        "picture": lambda path: save_figure(path, new_figure()),
        "report": lambda path: write_association_report(path, found, sources, ["scene"] * len(sources)),
        "report of tracks": lambda path: write_tracking_report(path, table.to_frame(), scene),
    }


def outcome(writer: Writer, path: Path) -> tuple[str, list[str], str]:
    """What a writer said when it was to replace an old file, the names in the folder, and the content then."""
    for one in path.parent.iterdir():
        if one.name != "filler":
            one.unlink()
    path.write_text("old")
    try:
        writer(path)
        said = ""
    except InvalidInputError as error:
        said = str(error)
    content = path.read_bytes()
    return said, sorted(os.listdir(path.parent)), "old" if content == b"old" else "new"


def main() -> None:
    """Run the program."""
    folder = Path(sys.argv[1])
    every = writers()
    import resource
    import signal

    # what a full disk says, without filling one
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
    small = [name for name in every if "report" not in name]
    print(json.dumps({name: outcome(every[name], folder / "out") for name in small}))


if __name__ == "__main__":
    main()
