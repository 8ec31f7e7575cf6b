"""``python -m assoc.track``: tracks from a scene, or from the radar plots of a CSV file.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from assoc._cli.lines import print_lines
from assoc._cli.options import flag_of
from assoc._cli.program import prepare_streams, run_program, write_all
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.scan_table import with_scan_table
from assoc._cli.signals import EarlyEnd, Interruption
from assoc._cli.speech import spoken
from assoc._cli.track.options import CUTOFF, FORMATS, RADAR, WINDOWS, make_tracker, read_options
from assoc._cli.track.options import completions as completions
from assoc._cli.values import number, seconds
from assoc._files.output import STDOUT, is_stream
from assoc._system.compile_time import compile_seconds
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.recordings import Recording
    from assoc.scene.scene import Scene
    from assoc.tracking import Tracker, TrackTable
    from assoc.tracking.plots import PlotTracks

_INTERRUPTION = Interruption("assoc.track")
_EARLY_END = EarlyEnd("assoc.track")
# seconds that the scan under way gets when the program is asked to end: tracks are known between scans only
_LAST_SCAN = 20.0


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as a process of its own."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    prepare_streams()
    if "--live" in words:
        # what has come in is still written
        _INTERRUPTION.interrupt_on_signals()
    else:
        _EARLY_END.on_signals()
    return main(words)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _track(words), "assoc.track", _INTERRUPTION)


def _track(words: list[str]) -> None:
    parsed, settings = read_options(words)
    if parsed["live"]:
        from assoc._cli.track.live import track_live

        track_live(parsed["file"], parsed, settings, _INTERRUPTION)
        return
    with spoken(quiet=parsed["quiet"], outputs=[parsed["output"], parsed["report"], parsed["rates"], parsed["map"]]):
        _make_tracks(words, parsed, settings)


def _make_tracks(words: list[str], parsed: dict[str, Any], settings: dict[str, Any]) -> None:
    file, cutoff = parsed["file"], parsed["cutoff"] or CUTOFF
    started, compiled = time.perf_counter(), compile_seconds()
    if _is_npz(file):
        if parsed["window"] is not None:
            raise InvalidInputError("--window: groups the plots of a CSV file; a scene already has scans")
        tracker, table, scene, total = _of_scene(file, parsed, settings)
        count, plots = scene.num_scans, None
    else:
        tracker, plots, total = _of_plots(file, parsed, settings)
        count, table, scene = len(plots.windows), plots.table, None
        if parsed["identity"] == "ignore":
            # nothing is judged by what was left out
            plots = plots._replace(rates=None, kept=None)
        table.origin = parsed["origin"]
    compiling = compile_seconds() - compiled
    elapsed = time.perf_counter() - started - compiling

    def write_report() -> None:
        if parsed["report"]:
            from assoc.plotting.report import write_tracking_report

            asked = tracker.settings.solver if tracker.solver_calls else "none"
            used = {"tracker": tracker.name, "solver": asked, "filter": parsed["filter"], "scans": count}
            more: dict[str, Any] = {"name": file, "settings": used, "cutoff": cutoff, "words": words}
            more["plots"] = plots
            write_tracking_report(parsed["report"], table.to_frame(), scene, **more)

    def write_tracks_on_map() -> None:
        if parsed["map"]:
            from assoc.exports.maps import write_map

            write_map(parsed["map"], table.to_frame())

    def write_rates() -> None:
        if parsed["rates"] and plots is not None:
            _write_rates(parsed["rates"], plots)

    if parsed["verbose"]:
        print_lines(", ".join(f"{name} {value}" for name, value in settings.items()))
    write_all(
        write_tracks_on_map,
        lambda: getattr(table, FORMATS[parsed["ending"]])(parsed["output"]),
        write_rates,
        write_report,
        lambda: _report(parsed["output"], count, tracker, table, elapsed, compiling),
        lambda: _compare(scene, table, cutoff),
        lambda: _report_rates(plots, parsed["identity"] or "score-only"),
    )
    _EARLY_END.say(f"the tracks of {count} of {total} scans are written")


def _is_npz(file: str) -> bool:
    """Whether a file is meant as a scene: by its first bytes, or by its name where it cannot be read."""
    if is_stream(file):
        # what is read of a pipe is gone, and a scene cannot come by one
        return False
    try:
        with open(file, "rb") as stream:
            start = stream.read(4)
    except OSError:
        return not file.lower().endswith(".csv")
    return start == b"PK\x03\x04" or file.lower().endswith(".npz")


def _is_asterix(file: str) -> bool:
    return file.lower().endswith((".ast", ".asterix", ".pcap"))


def _read_asterix(file: str, radar: str | None) -> Recording:
    """Plots of one radar of an ASTERIX file."""
    from assoc.integrations.asterix import read_asterix

    plots = {f"{sac}/{sic}": recording for (sac, sic), recording in sorted(read_asterix(file).plots.items())}
    if not plots:
        raise InvalidInputError(f"{file}: holds no plots (category 048)")
    if radar is None and len(plots) == 1:
        return next(iter(plots.values()))
    if radar not in plots:
        raise InvalidInputError(f"--radar: the file holds plots of {', '.join(plots)}; name one")
    return plots[radar]


def _of_scene(file: str, parsed: dict[str, Any], settings: dict[str, Any]) -> tuple[Tracker, TrackTable, Scene, int]:
    """The tracker, its tracks, the scene as far as it was tracked, and how many scans it has in all."""
    from assoc.scene.scene import Scene
    from assoc.tracking import smoothed, track_scene
    from assoc.tracking.filter_choice import pace_of
    from assoc.tracking.smoothing import check_smoothable

    parsed["filter"] = parsed["filter"] or "imm-cv"
    if parsed["identity"] is not None:
        raise InvalidInputError("--identity: is for plots; the measurements of a scene have no codes")
    if parsed["rates"] is not None:
        raise InvalidInputError("--rates: judges the plots of a CSV file; a scene with its truth is judged by GOSPA")
    for flag in ("rotation", "radar", *RADAR):
        if parsed[flag] is not None:
            raise InvalidInputError(f"{flag_of(flag)}: describes the radar of plots; a scene contains its own sensors")
    if parsed["registration"] is not None:
        if parsed["registration"] != "online":
            raise InvalidInputError(f"--registration: expected online, got {parsed['registration']!r}")
        settings["registration"] = "online"
    scene = Scene.load(file)
    if parsed["cutoff"] is not None and scene.truth is None:
        raise InvalidInputError(f"--cutoff: {file} has no truth with which tracks are compared")
    if parsed["smooth"]:
        check_smoothable(scene, corrects="registration" in settings)
    if parsed["origin"] is not None:
        scene = replace(scene, origin=parsed["origin"])
    elif parsed["map"] and scene.origin is None:
        raise InvalidInputError(f"--map: {file} does not say where it is on the earth; give --origin LAT,LON")
    name, pace = parsed["tracker"] or "multi-sensor", pace_of(scene.times)
    tracker = make_tracker(name, scene.sensors, parsed, settings, scene.region, pace)
    bar = ProgressBar("tracking", "scans", shown=not parsed["quiet"])
    numbers = with_progress(range(scene.num_scans), scene.num_scans, bar)
    numbers = with_scan_table(numbers, tracker, lambda k: (scene.times[k], scene.scan(k).sizes.tolist()))
    with _EARLY_END.work(_LAST_SCAN):
        table, decisions = track_scene(tracker, scene, confirmed=not parsed["all"], scans=numbers)
    bar.close()
    if not bar.done:
        _EARLY_END.say("")
    if parsed["smooth"]:
        table = smoothed(tracker, scene, decisions)
    tracked = scene if bar.done == scene.num_scans else scene.part(0, bar.done)
    return tracker, table, tracked, scene.num_scans


def _of_plots(file: str, parsed: dict[str, Any], settings: dict[str, Any]) -> tuple[Tracker, PlotTracks, int]:
    import numpy as np

    from assoc.recordings import Window, clustering_time_window, irregular_groups, radar_of, read_plots
    from assoc.tracking.plots import track_plots

    if parsed["registration"] is not None:
        raise InvalidInputError("--registration: biases of one radar alone cannot be observed; it is for scenes")
    name = parsed["tracker"] or "mht"
    parsed["filter"] = parsed["filter"] or "ekf"
    if name in ("multi-sensor", "static"):
        raise InvalidInputError(
            f"--tracker: {name} takes scenes; for plots use mht, mht-hypothesis, nearest-neighbour or "
            "joint-probabilistic"
        )
    window = parsed["window"] or "ctw"
    if window not in WINDOWS:
        raise InvalidInputError(f"--window: unknown name {window!r}; known: {', '.join(WINDOWS)}")
    radar: dict[str, Any] = {}
    for flag, (argument, unit) in RADAR.items():
        if parsed[flag] is not None:
            radar[argument] = unit * number(parsed[flag], flag_of(flag))
    turn = None if parsed["rotation"] is None else seconds(parsed["rotation"], "--rotation")
    if turn is not None and not window.startswith("ctw"):
        raise InvalidInputError(f"--rotation: is only for --window ctw or ctw-time, not for {window}")
    if parsed["cutoff"] is not None:
        raise InvalidInputError(
            "--cutoff: is for scenes, whose tracks are judged by GOSPA; plots are judged by identity"
        )
    if parsed["smooth"]:
        raise InvalidInputError("--smooth: is for scenes (.npz), not for plots")
    recording = _read_asterix(file, parsed["radar"]) if _is_asterix(file) else read_plots(file)
    if parsed["radar"] is not None and not _is_asterix(file):
        raise InvalidInputError("--radar: names a radar of an ASTERIX file; a table holds the plots of one")
    if parsed["rates"] and parsed["identity"] == "ignore":
        raise InvalidInputError("--rates: judges by the identities that --identity ignore leaves out")
    if parsed["rates"] and recording.aircraft is None:
        raise InvalidInputError(f"--rates: {file}: no plot has an identity (column mode3 or aircraft)")
    if window == "none":
        windows = [Window.of(recording, [row], row) for row in range(len(recording))]  # type: ignore[arg-type]
    elif window == "irregular":
        windows = irregular_groups(recording, np.random.default_rng(settings.get("seed", 0)))
    else:
        windows = clustering_time_window(recording, turn, by="antenna" if window == "ctw" else "time")
    print_lines(recording.summary())
    tracker = make_tracker(name, [radar_of(recording, **radar)], parsed, settings, None)
    if parsed["map"] and parsed["origin"] is None:
        raise InvalidInputError("--map: plots do not say where their radar stands; give --origin LAT,LON")
    bar = ProgressBar("tracking", "scans", shown=not parsed["quiet"])
    shown = with_progress(windows, len(windows), bar)
    shown = with_scan_table(shown, tracker, lambda window: (window.times[-1], [len(window)]))
    with _EARLY_END.work(_LAST_SCAN):
        done = track_plots(tracker, recording, shown, confirmed=not parsed["all"])
    bar.close()
    if not bar.done:
        _EARLY_END.say("")
    return tracker, done, len(windows)


def _write_rates(path: str, plots: PlotTracks) -> None:
    from assoc._files.output import write_text

    assert plots.rates is not None
    lines = ["window,time,plots,ct,mt,it"]
    for number_of, row in zip(plots.rates.windows.tolist(), plots.rates.per_window.tolist(), strict=True):
        cells = ["" if math.isnan(value) else f"{value:.2f}" for value in row]
        lines.append(f"{number_of + 1},{plots.ends[number_of]:g},{len(plots.windows[number_of])},{','.join(cells)}")
    write_text(path, "\n".join(lines) + "\n")


def _report_rates(plots: PlotTracks | None, identity: str) -> None:
    if plots is None:
        return
    if plots.kept is not None:
        kept, judged = plots.kept
        # what was used says nothing of how good the result is
        own = " (identities were used to make them)" if identity == "use" and plots.recording.sources is None else ""
        print_lines(f"{kept} of {judged} tracks with an identity kept one{own}")
    if plots.rates is None:
        return
    rates, known = plots.rates, "aircraft" if plots.recording.sources is not None else "Mode 3"
    figures = ", ".join(
        f"{name} {'-' if math.isnan(value) else f'{value:.1f} %'}"
        for name, value in (("CT", rates.ct), ("MT", rates.mt), ("IT", rates.it))
    )
    print_lines(f"{figures}: means over {len(rates.windows)} windows, aircraft known by {known} (docs/metrics.md)")


def _report(output: str, count: int, tracker: Tracker, table: TrackTable, elapsed: float, compiling: float) -> None:
    _, ids, _ = table.arrays()
    name = "stdout" if output == STDOUT else printable(output)
    print_lines(f"{name}: {len(set(ids.tolist()))} confirmed tracks, {len(table)} rows, {count} scans")
    each = 1e3 * elapsed / max(count, 1)
    # several trackers never need one, or only for what their own search leaves open
    used = tracker.settings.solver if tracker.solver_calls else "no solver used"
    spent = f"{elapsed:.2f} s, {each:.3g} ms a scan; {compiling:.2f} s more compiling"
    print_lines(f"{tracker.name}, {used}: {spent}")


def _compare(scene: Scene | None, table: TrackTable, cutoff: float) -> None:
    """Print the metrics if the truth is known."""
    if scene is None or scene.truth is None:
        return
    from assoc.metrics import Trajectories, summarise

    found = summarise(Trajectories.from_scene(scene), Trajectories(*table.arrays()), cutoff)
    print_lines(
        f"against the truth (cutoff {cutoff:g} m): root mean square GOSPA {found.gospa:.4g} m "
        f"(localisation {found.gospa_localisation:.4g}, missed {found.gospa_missed:.4g}, "
        f"false {found.gospa_false:.4g}), "
        f"{found.identity.switches} identity switches"
    )


if __name__ == "__main__":
    raise SystemExit(start())
