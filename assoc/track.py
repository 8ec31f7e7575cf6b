"""``python -m assoc.track``: makes tracks from a scene, or from recorded radar plots.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from assoc._cli.biases import print_biases
from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Given, Parser, check_scheduler, flag_of
from assoc._cli.program import Program, command, prepare_streams, write_all
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.scan_table import with_scan_table
from assoc._cli.signals import EarlyEnd
from assoc._cli.track.options import (
    CUTOFF,
    OF_PLOTS,
    OF_SCENES,
    RADAR,
    TRACKERS,
    TRACKS,
    make_tracker,
    read_options,
    track_parser,
    with_further,
)
from assoc._cli.track.radars_file import ASTERIX, read_asterix_plots
from assoc._files.output import STDOUT, is_stream
from assoc._system.compile_time import compile_seconds
from assoc._text.plain import printable
from assoc._text.times import decimals
from assoc.errors import InvalidInputError, LimitExceededError, warn

if TYPE_CHECKING:
    from assoc.metrics import CtMtIt
    from assoc.recordings import Recording, Window
    from assoc.recordings.survey import StoredPlots
    from assoc.scene.scene import Scene
    from assoc.tracking import Tracker, TrackTable
    from assoc.tracking.plots import PlotTracks

_EARLY_END = EarlyEnd("assoc.track")
_USUAL = {
    "range_noise": "30 to 150 m are usual",
    "azimuth_noise": "0.05 to 0.2 degrees are usual",
    "rotation": "4 to 12 seconds are usual",
}
# seconds that the current scan gets when the program is asked to end: tracks are complete only between scans
_LAST_SCAN = 20.0
# seconds of a slice
_SLICE = 900.0


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
    check_scheduler(given)
    if given["check"] and given["no_adapt"]:
        raise InvalidInputError("--check: nothing is estimated with --no-adapt; leave one of them out")
    with messages(given):
        _make_tracks(given, settings)


class _Tracked(NamedTuple):
    """Tracks of a scene or of plots, and how many of all scans were tracked."""

    tracker: Tracker
    table: TrackTable
    scene: Any
    plots: Any
    num_tracked: int
    total: int
    whole: PlotTracks | None = None
    """For reports."""
    missing: Sequence[str] = ()
    """Files and slices that they lack."""


class _Judged(NamedTuple):
    """Tracks of plots against the plots' identities."""

    ends: Any
    """The tracker's time after each window, seconds."""
    sizes: list[int]
    """Plots of each window."""
    sourced: bool
    """Whether the aircraft are known, and not only codes."""
    rates: CtMtIt | None
    kept: tuple[int, int] | None


def _make_tracks(given: Given, settings: dict[str, Any]) -> None:
    file = given["file"]
    started, compiled = time.perf_counter(), compile_seconds()
    if len(given["files"]) > 1 and not all(_has_plots(one) for one in given["files"]):
        raise InvalidInputError(f"{given['files'][1]}: only recorded plots may be in several files")
    of = _of_radars if file.lower().endswith(".toml") else _of_scene if _is_npz(file) else _of_plots
    found = of(file, given, settings)
    compiling = compile_seconds() - compiled
    elapsed = time.perf_counter() - started - compiling
    if given["verbose"]:
        print_lines(", ".join(f"{name} {value}" for name, value in settings.items()))
    write_all(
        (given["map"], lambda: _write_map(given["map"], found.table)),
        (given["asterix"], lambda: _write_asterix(given["asterix"], found)),
        (given["output"], lambda: _write_tracks(given["output"], found.table)),
        (given["rates"], lambda: _write_rates(given["rates"], found.plots)),
        (given["report"], lambda: _write_report(given, found)),
        (given, lambda: _print_counts(given["output"], found, elapsed, compiling)),
        (given["check"], lambda: print_lines(str(found.tracker.health))),
        (found.scene and found.scene.truth, lambda: _compare(found.scene, found.table, given["cutoff"] or CUTOFF)),
        (found.plots, lambda: _print_rates(found.plots, given["identity"])),
    )
    _EARLY_END.say(f"the tracks of {found.num_tracked} of {found.total} scans are written")
    if found.missing:
        again = "; the same command does what is left" if given["jobs"] or given["scheduler"] or given["slice"] else ""
        raise LimitExceededError(f"{given['output']}: written without {', '.join(found.missing)}{again}")


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
    return start == b"PK\x03\x04" or file.lower().endswith(".npz")


def _has_plots(file: str) -> bool:
    return not file.lower().endswith(".toml") and not _is_npz(file)


def _is_asterix(file: str) -> bool:
    return file.lower().endswith(ASTERIX)


def _of_radars(file: str, given: Given, settings: dict[str, Any]) -> _Tracked:
    """Track the radars of a description."""
    from assoc._cli.track.radars_file import read_radars
    from assoc.tracking import smoothed, track_scene

    given.check_use((*OF_SCENES, *OF_PLOTS), input="radars")
    if given["origin"] is not None:
        raise InvalidInputError(f"--origin: {file} says where the radars stand")
    given["filter"] = given["filter"] or "imm-cv"
    if given["registration"] == "online":
        raise InvalidInputError("--registration: online needs scans of one instant; take first")
    found = read_radars(file)
    scene, scans = _registered(found.scene, given, settings), range(found.scene.num_scans)
    known = None if given["identity"] == "ignore" else found.identities
    tracker = make_tracker(
        given["tracker"] or "multi-sensor", scene.sensors, given, settings, scene.region, min(found.turns)
    )
    (tracks, decisions), count = _watched(
        given,
        tracker,
        scans,
        lambda k: (scene.times[k], scene.scan(k).sizes.tolist()),
        lambda scans: track_scene(tracker, scene, confirmed=not given["all"], scans=scans, identities=known),
        len(scans),
    )
    if given["smooth"]:
        named, tracks = tracks, smoothed(tracker, scene, decisions)
        tracks.take_names(named)
    tracked = scene if count == scene.num_scans else scene.part(0, count)
    return _Tracked(tracker, tracks, tracked, None, count, scene.num_scans)


def _of_scene(file: str, given: Given, settings: dict[str, Any]) -> _Tracked:
    from assoc.scene.scene import Scene
    from assoc.tracking import smoothed, track_scene
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
    name, pace = given["tracker"] or "multi-sensor", pace_of(scene.times)
    tracker = make_tracker(name, scene.sensors, given, settings, scene.region, pace, scene)
    (tracks, decisions), count = _watched(
        given,
        tracker,
        range(scene.num_scans),
        lambda k: (scene.times[k], scene.scan(k).sizes.tolist()),
        lambda scans: track_scene(tracker, scene, confirmed=not given["all"], scans=scans),
        scene.num_scans,
    )
    if given["smooth"]:
        tracks = smoothed(tracker, scene, decisions)
    tracked = scene if count == scene.num_scans else scene.part(0, count)
    return _Tracked(tracker, tracks, tracked, None, count, scene.num_scans)


def _registered(scene: Scene, given: Given, settings: dict[str, Any]) -> Scene:
    """The scene without the biases of its sensors, if they are to be found first."""
    from assoc.registration import register
    from assoc.tracking.smoothing import check_smoothable

    if given["registration"] != "first":
        settings |= given.some(("registration",))
        if given["smooth"]:
            check_smoothable(corrects="registration" in settings)
        return scene
    found = register(scene, components=("range", "azimuth", "elevation", "gain"), seed=settings.get("seed", 0))
    print_biases(found)
    return found.correct(scene)


def _of_plots(file: str, given: Given, settings: dict[str, Any]) -> _Tracked:
    import numpy as np

    from assoc.recordings import radar_of, with_heights
    from assoc.recordings.recording import joined
    from assoc.tracking import TrackTable
    from assoc.tracking.plots import FORGET, TakenPlots, follow, known_of, may_return, track_plots
    from assoc.tracking.track_table import LongTable

    given["window"], given["filter"] = given["window"] or "ctw", given["filter"] or "ekf"
    kind, identity = "ASTERIX files" if _is_asterix(file) else "tables", given["identity"] or "score-only"
    given.check_use((*OF_SCENES, *OF_PLOTS), input="plots", format=kind, window=given["window"], identity=identity)
    name = given["tracker"] or "mht"
    if name in ("multi-sensor", "static"):
        others = ", ".join(other for other in TRACKERS if other not in ("multi-sensor", "static"))
        raise InvalidInputError(f"--tracker: {name} takes scenes; for plots use one of {others}")
    if given["map"] and given["origin"] is None:
        raise InvalidInputError("--map: plots do not say where their radar stands; give --origin LAT,LON")
    stored, notes, left = _stored_plots(given)
    survey = stored.survey
    with _as_options():
        windows = _Windows(stored, given, settings.get("seed", 0))
        print_lines(survey.summary(notes))
        radar = radar_of(survey, **{RADAR[flag]: value for flag, value in given.some(RADAR).items()})
    tracker = make_tracker(name, with_heights(radar, survey), given, settings, None)
    # these show all tracks at once
    whole = any(given[name] for name in ("smooth", "report", "map", "asterix"))
    sliced = given["jobs"] or given["scheduler"] or given["slice"]
    if sliced and (whole or given["check"]):
        raise InvalidInputError("--slice, --jobs, --scheduler: leave out --smooth, --report, --map, --asterix, --check")

    def track(scans: Iterator[Window]) -> tuple[Any, _Judged, PlotTracks | None]:
        if whole:
            recording = joined([*stored], notes, os.path.basename(file))
            done = track_plots(tracker, recording, scans, confirmed=not given["all"], smooth=given["smooth"])
            done.table.origin = given["origin"]
            sizes = [len(window) for window in done.windows]
            return done.table, _Judged(done.ends, sizes, stored.sourced, done.rates, done.kept), done
        takers = TakenPlots(survey.named, stored.addressed)
        table, ends, sizes = LongTable(given["origin"]), [], []
        for followed in follow(tracker, scans, forget=True):
            takers.take(followed)
            table.names.count_identities(followed.tracks, known_of(followed.window)[:, 1:])
            table.add(*followed.listed(not given["all"]))
            ends.append(float(followed.step.time))
            sizes.append(len(followed.window))
            if len(ends) % FORGET == 0:
                takers.keep(may_return(tracker))
        table.finish()
        return table, _Judged(np.array(ends), sizes, stored.sourced, takers.rates(), takers.kept()), None

    if sliced:
        table, judged, missing = _in_slices(given, tracker, windows, stored)
        plots, count = None, len(judged.ends)
    else:
        turns = 1 + (survey.last - survey.first) / windows.rotation
        (table, judged, plots), count = _watched(
            given, tracker, windows, lambda window: (window.times[-1], [len(window)]), track, total=math.ceil(turns)
        )
        missing = []
    if given["identity"] == "ignore":
        # do not judge by plots that were left out
        judged = judged._replace(rates=None, kept=None)
        plots = plots and plots._replace(rates=None, kept=None)
        (table if whole else table.names).take_names(TrackTable())
    total = sum(1 for _ in windows) if _EARLY_END.asked else count
    return _Tracked(tracker, table, None, judged, count, total, plots, missing=[*left, *missing])


def _in_slices(
    given: Given, tracker: Tracker, windows: _Windows, stored: StoredPlots
) -> tuple[Any, _Judged, list[str]]:
    """Track slices of the recording, write their tracks, and name what is missing."""
    import numpy as np

    from assoc._cli.track.slices import kept_slices
    from assoc.tracking.plots import TakenPlots
    from assoc.tracking.slices import Stitching, TrackSlice, overlap
    from assoc.tracking.track_table import LongTable

    work = TrackSlice(tracker, not given["all"], given["origin"])
    places = {"jobs": given["jobs"] or 1, "scheduler": given["scheduler"]}
    takers, stitching = TakenPlots(stored.survey.named, stored.addressed), Stitching()
    ends, sizes = [], []
    with kept_slices(given, given["files"]) as slices:
        try:
            with _EARLY_END.work(0.0):
                slices.run(work, windows, given["slice"] or _SLICE, overlap(tracker, windows.rotation), places)
        except KeyboardInterrupt:
            _EARLY_END.say(f"{len(slices.done())} slices are kept; the same command goes on from there")
            raise
        table = LongTable(given["origin"])
        for part in filter(None, map(slices.load, slices.done())):
            part = stitching.add(part)
            table.add_frame(part.frame)
            table.names.count_identities(part.tracks, part.known[:, 1:])
            takers.add(np.repeat(np.arange(len(part.sizes)), part.sizes), part.known, part.tracks, part.sure)
            takers.keep({*part.tracks.tolist()})
            ends.append(part.ends)
            sizes += part.sizes.tolist()
        table.finish()
        missing = slices.missing()
    times = np.concatenate([np.zeros(0), *ends])
    return table, _Judged(times, sizes, stored.sourced, takers.rates(), takers.kept()), missing


@contextmanager
def _as_options() -> Iterator[None]:
    """Name in errors the options instead of the library's arguments, with usual values."""
    try:
        yield
    except InvalidInputError as error:
        text = str(error)
        if " rotation time " in text:
            text = f"rotation: {text}"
        name, _, rest = text.partition(": ")
        flags = {**{argument: flag for flag, argument in RADAR.items()}, "rotation": "rotation"}
        if name not in flags:
            raise
        usual = f" ({_USUAL[name]})" if name in _USUAL else ""
        raise InvalidInputError(f"{flag_of(flags[name])}: {rest}{usual}") from None


def _stored_plots(given: Given) -> tuple[StoredPlots, Mapping[str, int], list[str]]:
    """The plots of the files, read part by part, what reading had to correct, and what could not be read."""
    import numpy as np

    from assoc.recordings.survey import StoredPlots

    files, notes = given["files"], Counter[str]()
    left: list[str] = []
    first = {}
    for file in files:
        try:
            first[file] = next(_parts(file, given, Counter())).times[0] if len(files) > 1 else 0.0
        except InvalidInputError as error:
            left.append(str(error))
    if len(left) == len(files):
        raise InvalidInputError(left[0])

    def parts() -> Iterator[Recording]:
        end, behind, latest = -math.inf, "", np.zeros((0, 2))
        for file in sorted(first, key=lambda file: float(first[file])):
            before, late, last = end, 0, None
            try:
                for part in _parts(file, given, notes):
                    # a file may begin at the instant at which the one before ends, with other plots
                    twice = (part.measurements[:, None] == latest).all(axis=2).any(axis=1) & (part.times == before)
                    kept = (part.times >= before) & ~twice
                    late += len(part) - int(kept.sum())
                    if kept.any():
                        part = part.take(kept)
                        end, last = float(part.times[-1]), part
                        yield part
            except InvalidInputError as error:
                if len(files) == 1:
                    raise
                left.append(str(error))
            if late:
                left.append(f"{late} plots of {file}, which are before the end of {behind}")
            if last is not None:
                behind, latest = file, last.measurements[last.times == end]

    stored = StoredPlots(parts())
    for line in left:
        warn(f"left out: {line}")
    if given["rates"] and not stored.survey.named:
        raise InvalidInputError(f"--rates: {files[0]}: no plot has an identity (column mode3 or aircraft)")
    return stored, notes, left


def _parts(file: str, given: Given, notes: Counter[str]) -> Iterator[Recording]:
    """The plots of a file part by part; what reading had to correct is counted in the notes."""
    from assoc.recordings.reading import PlotReader

    if _is_asterix(file):
        content, source = read_asterix_plots(file, given["radar"], "--radar")
        yield content.plots[source]
        notes.update(content.plots[source].notes)
    else:
        reader = PlotReader(file)
        yield from reader
        notes.update(reader.notes)


class _Windows:
    """The plots, grouped into scans, one after the other."""

    def __init__(self, stored: StoredPlots, given: Given, seed: int) -> None:
        from assoc.recordings import estimate_rotation

        self._stored, self._kind, self._seed = stored, given["window"], seed
        self.rotation = given["rotation"] or 1.0
        if self._kind in ("ctw", "ctw-time"):
            self.rotation = given["rotation"] or estimate_rotation(stored)

    def __iter__(self) -> Iterator[Window]:
        import numpy as np

        from assoc.recordings import Window, irregular_groups
        from assoc.recordings.recording import joined
        from assoc.recordings.windows import windows_in_turn

        if self._kind == "none":
            begin = 0
            for part in self._stored:
                for row in range(len(part)):
                    window = Window.of(part, np.array([row]), begin + row)
                    yield replace(window, rows=window.rows + begin)
                begin += len(part)
        elif self._kind == "irregular":
            yield from irregular_groups(joined([*self._stored], {}, ""), np.random.default_rng(self._seed))
        else:
            by: Any = "antenna" if self._kind == "ctw" else "time"
            yield from windows_in_turn(self._stored, self._stored.survey, self.rotation, by=by)


def _watched(
    given: Given,
    tracker: Tracker,
    scans: Iterable[Any],
    describe: Callable[[Any], tuple[float, Sequence[int]]],
    track: Callable[[Iterator[Any]], Any],
    total: int,
) -> tuple[Any, int]:
    """Track the scans and show progress; returns the result, and how many of them were tracked."""
    bar = ProgressBar("tracking", "scans", shown=not given["quiet"])
    with _EARLY_END.work(_LAST_SCAN):
        found = track(with_scan_table(with_progress(scans, total, bar), tracker, describe))
    bar.close()
    if not bar.done:
        _EARLY_END.say("")
    return found, bar.done


def _write_map(path: str, tracks: TrackTable) -> None:
    from assoc.exports.maps import write_map

    write_map(path, tracks.to_frame())


def _write_asterix(path: str, found: _Tracked) -> None:
    from assoc.integrations.asterix import write_tracks

    frame = found.table.to_frame()
    if found.table.identities:
        # aircraft with a transponder have heights by Mode C, if any sensor has heights by it
        mode_c = found.plots or any("height" in one.components[: one.dim] for one in found.tracker.sensors)
        frame["barometric"] = bool(mode_c) & ((frame["address_hex"] != "") | (frame["mode3_oct"] != ""))
    write_tracks(path, frame)


def _write_tracks(path: str, tracks: Any) -> None:
    if not hasattr(tracks, "to_csv"):
        tracks.write(path)
    elif TRACKS.ending(path) == ".parquet":
        tracks.to_parquet(path)
    else:
        tracks.to_csv(path)


def _write_report(given: Given, found: _Tracked) -> None:
    from assoc.plotting.report import write_tracking_report

    tracker = found.tracker
    used = {
        "tracker": tracker.name,
        "solver": tracker.settings.solver if tracker.solver_calls else "none",
        "filter": given["filter"],
        "scans": found.num_tracked,
    }
    write_tracking_report(
        given["report"],
        found.table.to_frame(),
        found.scene,
        name=given["file"],
        settings=used,
        cutoff=given["cutoff"] or CUTOFF,
        words=given.words,
        plots=found.whole,
    )


def _write_rates(path: str, plots: _Judged) -> None:
    from assoc._files.output import write_text

    assert plots.rates is not None
    lines = ["window,time,plots,ct,mt,it"]
    for number_of, row in zip(plots.rates.windows.tolist(), plots.rates.per_window.tolist(), strict=True):
        cells = ["" if math.isnan(value) else f"{value:.2f}" for value in row]
        lines.append(f"{number_of + 1},{decimals(plots.ends[number_of], 6)},{plots.sizes[number_of]},{','.join(cells)}")
    write_text(path, "\n".join(lines) + "\n")


def _print_rates(plots: _Judged, identity: str | None) -> None:
    if plots.kept is not None:
        kept, judged = plots.kept
        # identities that made the tracks are no evidence of their quality
        note = " (identities were used to make them)" if identity == "use" and not plots.sourced else ""
        print_lines(f"{kept} of {judged} tracks with an identity kept one{note}")
    if plots.rates is None:
        return
    rates, known = plots.rates, "aircraft" if plots.sourced else "Mode 3"
    figures = ", ".join(
        f"{name} {'-' if math.isnan(value) else f'{value:.1f} %'}"
        for name, value in (("CT", rates.ct), ("MT", rates.mt), ("IT", rates.it))
    )
    print_lines(f"{figures}: means over {len(rates.windows)} windows, aircraft known by {known} (docs/metrics.md)")


def _print_counts(output: str, found: _Tracked, elapsed: float, compiling: float) -> None:
    from assoc.tracking.filter_choice import height_note

    tracker, rows = found.tracker, found.table
    name = "stdout" if output == STDOUT else printable(output)
    print_lines(f"{name}: {len(rows.confirmed_ids())} confirmed tracks, {len(rows)} rows, {found.num_tracked} scans")
    each = 1e3 * elapsed / max(found.num_tracked, 1)
    # several trackers never need the solver, or only for the rest of their own search
    used = tracker.settings.solver if tracker.solver_calls else "no solver used"
    spent = f"{elapsed:.2f} s, {each:.3g} ms a scan; {compiling:.2f} s more compiling"
    print_lines(f"{tracker.name}, {used}: {spent}")
    worst = sorted(rows.inconsistent().items(), key=lambda one: -one[1])
    if worst:
        shown = ", ".join(f"{track} ({nis:.2g})" for track, nis in worst[:5]) + (", ..." if len(worst) > 5 else "")
        print_lines(f"tracks that do not agree with their measurements (NIS, at most 1 expected): {shown}")
    note = height_note(tracker.sensors, len(tracker.filter.motion.position))
    if note is not None:
        print_lines(note)


def _compare(scene: Scene, tracks: TrackTable, cutoff: float) -> None:
    """Print the metrics against the truth."""
    from assoc.metrics import Trajectories, summarise
    from assoc.tracking.track_table import against_truth

    compared = against_truth(scene, Trajectories(*tracks.arrays()))
    found, level = summarise(*compared, cutoff), ", horizontally" if compared[0].positions.shape[1] == 2 else ""
    print_lines(
        f"against the truth (cutoff {cutoff:g} m{level}): root mean square GOSPA {found.gospa:.4g} m "
        f"(localisation {found.gospa_localisation:.4g}, missed {found.gospa_missed:.4g}, "
        f"false {found.gospa_false:.4g}), {found.identity.switches} identity switches"
    )


def parser() -> Parser:
    """Return the parser with all options."""
    return with_further(track_parser())


if __name__ == "__main__":
    raise SystemExit(start())
