"""``python -m assoc.track``: makes tracks from a scene, or from recorded radar plots.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import copy
import itertools
import math
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from assoc._cli.biases import print_biases
from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Given, Parser
from assoc._cli.program import Program, command, prepare_streams
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.signals import EarlyEnd
from assoc._cli.track.options import (
    OF_PLOTS,
    OF_SCENES,
    RADAR,
    TRACKERS,
    closing,
    make_tracker,
    read_options,
    track_parser,
    with_further,
)
from assoc._cli.track.plots import Windows, as_options, stored_plots
from assoc._cli.track.results import Judged, Tracked, write_and_print
from assoc._files.output import is_stream
from assoc._files.reading import kind_of
from assoc._system.compile_time import compile_seconds
from assoc._text.plain import printable
from assoc.errors import InvalidInputError, LimitExceededError

if TYPE_CHECKING:
    from assoc.recordings import Window
    from assoc.recordings.survey import StoredPlots
    from assoc.scene.scene import Scene
    from assoc.tracking import Tracker
    from assoc.tracking.offline.ended_tracks import EndedTracks
    from assoc.tracking.offline.plots import PlotTracks

_EARLY_END = EarlyEnd("assoc.track")
# seconds that the current scan gets when the program is asked to end: tracks are complete only between scans
_LAST_SCAN = 20.0


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as the whole process."""
    prepare_streams()
    program, words = _program(arguments)
    return program.start(words)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    program, words = _program(arguments)
    return program.main(words)


def _program(arguments: Sequence[str] | None) -> tuple[Program, list[str]]:
    """Return the called program and its words: `assoc.live` for ``--live``, its former name."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if "--live" not in words:
        return Program("assoc.track", _track, _EARLY_END.on_signals), words
    from assoc.live import PROGRAM

    words.remove("--live")
    called = printable(f"{command('live')} {shlex.join(words)}")
    print(f"assoc.track: warning: --live is a program of its own now: {called}", file=sys.stderr, flush=True)
    return PROGRAM, words


def _track(words: list[str]) -> None:
    given, settings = read_options(words, track_parser())
    given.check_outputs(given["files"])
    given["file"] = given["files"][0]
    if given["check"] and given["no_adapt"]:
        raise InvalidInputError("--check: nothing is estimated with --no-adapt; leave one of them out")
    with messages(given):
        _make_tracks(given, settings)


def _make_tracks(given: Given, settings: dict[str, Any]) -> None:
    file = given["file"]
    started, compiled = time.perf_counter(), compile_seconds()
    if len(given["files"]) > 1 and not all(_has_plots(path) for path in given["files"]):
        raise InvalidInputError(f"{given['files'][1]}: only recorded plots may be in several files")
    of = _of_radars if file.lower().endswith(".toml") else _of_scene if _is_npz(file) else _of_plots
    with ExitStack() as outputs:
        found = of(file, given, settings, outputs)
        compiling = compile_seconds() - compiled
        elapsed = time.perf_counter() - started - compiling
        if given["verbose"]:
            print_lines(", ".join(f"{name} {value}" for name, value in settings.items()))
        write_and_print(found, given, elapsed, compiling)
    _EARLY_END.say(f"the tracks of {found.num_tracked} of {found.total} scans are written")
    if found.missing:
        raise LimitExceededError(f"{given['output']}: written without {', '.join(found.missing)}")


def _is_npz(file: str) -> bool:
    """Whether a file is meant as a scene: by its first bytes, or by its name if it cannot be read."""
    if is_stream(file):
        # bytes read from a pipe are gone, and a scene cannot be read from one
        return False
    try:
        with open(file, "rb") as stream:
            start = stream.read(4)
    except OSError:
        return not file.lower().endswith(".csv")
    return (start == b"PK\x03\x04" and not file.lower().endswith(".zip")) or file.lower().endswith(".npz")


def _has_plots(file: str) -> bool:
    return not file.lower().endswith(".toml") and not _is_npz(file)


def _of_radars(file: str, given: Given, settings: dict[str, Any], _: ExitStack) -> Tracked:
    """Track the radars of a description."""
    from assoc._cli.track.radars_file import read_radars

    given.check_use((*OF_SCENES, *OF_PLOTS), input="radars")
    if given["origin"] is not None:
        raise InvalidInputError(f"--origin: {file} says where the radars stand")
    given["filter"] = given["filter"] or "imm-cv"
    found = read_radars(file)
    settings["initiation"] = closing(settings["initiation"], found.closed)
    scene = _registered(found.scene, given, settings, found.references)
    identities = None if given["identity"] == "ignore" else found.identities
    tracked = _of_scans(scene, given, settings, found.shortest, identities)
    low, high = scene.region[2].tolist()
    return tracked._replace(tall=high - low > 10_000.0)


def _of_scene(file: str, given: Given, settings: dict[str, Any], _: ExitStack) -> Tracked:
    from assoc.scene.scene import Scene
    from assoc.tracking.filter_choice import pace_of

    given.check_use((*OF_SCENES, *OF_PLOTS), input="scenes")
    given["filter"] = given["filter"] or "imm-cv"
    scene = Scene.load(file)
    scene.check_platforms(file)
    if given["cutoff"] is not None and scene.truth is None:
        raise InvalidInputError(f"--cutoff: {file} has no truth with which tracks are compared")
    scene = _registered(scene, given, settings)
    if given["origin"] is not None:
        scene = replace(scene, origin=given["origin"])
    elif given["map"] and scene.origin is None:
        raise InvalidInputError(f"--map: {file} does not say where it is on the earth; give --origin LAT,LON")
    return _of_scans(scene, given, settings, pace_of(scene.times))


def _of_scans(scene: Scene, given: Given, settings: dict[str, Any], pace: float, identities: Any = None) -> Tracked:
    """Track the scans of a scene."""
    from assoc.tracking import smoothed, track_scene
    from assoc.tracking.target_kinds import evidence_of

    def made(given: Given) -> Tracker:
        name = given["tracker"] or "multi-sensor"
        return make_tracker(name, scene.sensors, given, settings, scene.region, pace, scene)

    tracker = made(given)
    (tracks, decisions), count = _watched(
        given,
        range(scene.num_scans),
        lambda scans: track_scene(tracker, scene, confirmed=not given["all"], scans=scans, identities=identities),
        scene.num_scans,
    )
    if given["smooth"]:
        named, tracks = tracks, smoothed(tracker, scene, decisions)
        if identities is not None:
            tracks.take_names(named)
    tracked = scene if count == scene.num_scans else scene.part(0, count)
    again = _again(given, lambda other: evidence_of(made(other), scene))
    return Tracked(tracker, tracks, tracked, None, count, scene.num_scans, again=again)


def _again(given: Given, evidence: Callable[[Given], float]) -> Callable[[str | None], float] | None:
    """What the tracks of another kind of targets score, by its name; None where the kind or the speed was given."""

    def of(kind: str | None) -> float:
        other = copy.copy(given)
        other["targets"] = kind
        return evidence(other)

    return of if given["targets"] is None and given["speed"] is None else None


def _registered(scene: Scene, given: Given, settings: dict[str, Any], references: Sequence[str] = ()) -> Scene:
    """The scene without the biases of its sensors, if they are to be found first; references have none."""
    from assoc.registration import register

    if given["registration"] is None:
        return scene
    found = register(
        scene,
        components=("range", "azimuth", "elevation", "gain"),
        reference=references,
        seed=settings.get("seed", 0),
    )
    print_biases(found)
    return found.correct(scene)


def _of_plots(file: str, given: Given, settings: dict[str, Any], outputs: ExitStack) -> Tracked:
    from assoc.recordings import radar_of, with_heights
    from assoc.recordings.recording import joined
    from assoc.tracking import TrackTable
    from assoc.tracking.offline.plots import PlotTracks, follow, track_plots
    from assoc.tracking.target_kinds import SCANS, evidence_in

    given["window"], given["filter"] = given["window"] or "ctw", given["filter"] or "ekf"
    kind, identity = "ASTERIX files" if kind_of(file) == "asterix" else "tables", given["identity"] or "score-only"
    given.check_use((*OF_SCENES, *OF_PLOTS), input="plots", format=kind, window=given["window"], identity=identity)
    name = given["tracker"] or "mht"
    if name in ("multi-sensor", "static"):
        others = ", ".join(other for other in TRACKERS if other not in ("multi-sensor", "static"))
        raise InvalidInputError(f"--tracker: {name} takes scenes; for plots use one of {others}")
    if given["map"] and given["origin"] is None:
        raise InvalidInputError("--map: plots do not say where their radar stands; give --origin LAT,LON")
    stored, notes, left = stored_plots(given)
    survey = stored.survey
    with as_options():
        windows = Windows(stored, given, settings.get("seed", 0))
        print_lines(survey.summary(notes))
        radar = radar_of(survey, **{RADAR[flag]: value for flag, value in given.some(RADAR).items()})

    def made(given: Given) -> Tracker:
        return make_tracker(name, with_heights(radar, survey), given, settings, None)

    def evidence(other: Given) -> float:
        tracker = made(other)
        return evidence_in(tracker, follow(tracker, itertools.islice(windows, SCANS), forget=True))

    tracker = made(given)
    # these show all tracks at once
    whole = any(given[name] for name in ("report", "map", "asterix"))
    plots = None
    judged: Any
    table: Any = None if whole else _ended_tracks(given, stored, outputs)

    def track(scans: Iterator[Window]) -> PlotTracks | Judged:
        if not whole:
            return _take(given, tracker, scans, table, stored)
        recording = joined([*stored], notes, os.path.basename(file))
        return track_plots(tracker, recording, scans, confirmed=not given["all"], smooth=given["smooth"])

    turns = 1 + (survey.last - survey.first) / windows.rotation
    judged, count = _watched(given, windows, track, total=math.ceil(turns))
    if isinstance(judged, PlotTracks):
        plots, table = judged, judged.table
        table.origin = given["origin"]
        sizes = [len(window) for window in plots.windows]
        judged = Judged(plots.ends, sizes, stored.sourced, plots.rates, plots.kept)
    if given["identity"] == "ignore":
        # do not judge by plots that were left out
        judged = judged._replace(rates=None, kept=None)
        plots = plots and plots._replace(rates=None, kept=None)
        if whole:
            table.take_names(TrackTable())
    total = sum(1 for _ in windows) if _EARLY_END.asked else count

    def finish() -> None:
        # an error discards what is not finished, and leaves its room to other outputs
        with outputs.pop_all():
            table.finish()

    ends_here = None if whole else finish
    again = _again(given, evidence)
    return Tracked(tracker, table, None, judged, count, total, plots, left, ends_here, again)


def _take(given: Given, tracker: Tracker, scans: Iterator[Window], table: EndedTracks, stored: StoredPlots) -> Judged:
    """Track windows, and hand tracks to the table as they end, or smoothed when they have."""
    import numpy as np

    from assoc.tracking.offline.ended_smoothing import EndedSmoothing
    from assoc.tracking.offline.plots import FORGET, TakenPlots, follow, known_of
    from assoc.tracking.state import may_return

    takers, ends, sizes = TakenPlots(stored.survey.named, stored.addressed), list[float](), list[int]()
    smoothing = EndedSmoothing(tracker, given["origin"]) if given["smooth"] else None
    for followed in follow(tracker, scans, forget=True):
        takers.take(followed)
        table.count_identities(followed.tracks, known_of(followed.window)[:, 1:])
        if smoothing is None:
            table.add(*followed.listed(not given["all"]))
        else:
            smoothing.take(followed.step, followed.measurements, followed.times, followed.altitudes)
        ends.append(float(followed.step.time))
        sizes.append(len(followed.window))
        if len(ends) % FORGET == 0:
            living = may_return(tracker.state)
            takers.keep(living)
            if smoothing is None:
                table.end(living)
            else:
                table.add_frame(smoothing.end(living).to_frame())
    if smoothing is not None:
        table.add_frame(smoothing.finish().to_frame())
    return Judged(np.array(ends), sizes, stored.sourced, takers.rates(), takers.kept())


def _ended_tracks(given: Given, stored: StoredPlots, outputs: ExitStack) -> EndedTracks:
    """Takes rows of tracks, and writes them as the tracks end; the file takes its name when `outputs` are closed."""
    from assoc._files.tables import table_writer
    from assoc.tracking.offline.ended_tracks import EndedTracks

    identified = given["identity"] != "ignore" and (stored.survey.coded or stored.addressed)
    return EndedTracks(outputs.enter_context(table_writer(given["output"])), given["origin"], identified)


def _watched(
    given: Given,
    scans: Iterable[Any],
    track: Callable[[Iterator[Any]], Any],
    total: int,
) -> tuple[Any, int]:
    """Track the scans and show progress; returns the result, and how many of them were tracked."""
    bar = ProgressBar("tracking", "scans", shown=not given["quiet"])
    with _EARLY_END.work(_LAST_SCAN):
        found = track(with_progress(scans, total, bar))
    bar.close()
    if not bar.done:
        _EARLY_END.say("")
    return found, bar.done


def parser() -> Parser:
    """Return the parser with all options."""
    return with_further(track_parser())


if __name__ == "__main__":
    raise SystemExit(start())
