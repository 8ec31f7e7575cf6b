"""What ``assoc track`` writes and prints when its tracks are made."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from assoc._cli.lines import print_lines
from assoc._cli.options import Given
from assoc._cli.program import write_all
from assoc._cli.track.options import CUTOFF, TRACKS
from assoc._files.output import STDOUT
from assoc._text.plain import printable
from assoc._text.times import decimals

if TYPE_CHECKING:
    from assoc.metrics import CtMtIt
    from assoc.scene.scene import Scene
    from assoc.tracking import Tracker, TrackTable
    from assoc.tracking.offline.plots import PlotTracks


# confirmed tracks of fewer scans on average may be of false alarms
_SHORT = 10


class Tracked(NamedTuple):
    """Tracks of a scene or of plots, and how many of all scans were tracked."""

    tracker: Tracker
    table: Any
    """TrackTable, or EndedTracks where they were written as they ended."""
    scene: Any
    plots: Any
    num_tracked: int
    total: int
    whole: PlotTracks | None = None
    """For reports."""
    missing: Sequence[str] = ()
    """Files that they lack."""
    finish: Callable[[], object] | None = None
    """Writes the rest of tracks that were written as they ended."""
    again: Callable[[str | None], float] | None = None
    """Score of the tracks that the first scans give with targets of another kind; None where the kind was given."""
    tall: bool = False
    """Whether a description of radars leaves open how high targets are."""


class Judged(NamedTuple):
    """Tracks of plots against the plots' identities."""

    ends: Any
    """The tracker's time after each window, seconds."""
    sizes: list[int]
    """Plots of each window."""
    sourced: bool
    """Whether the aircraft are known, and not only codes."""
    rates: CtMtIt | None
    kept: tuple[int, int] | None


def write_and_print(found: Tracked, given: Given, elapsed: float, compiling: float) -> None:
    """Write all files asked for and print what has been found, whatever of it fails.

    `elapsed` and `compiling` are seconds of tracking, and of compiling beside it.
    """
    write_all(
        (given["map"], lambda: _write_map(given["map"], found.table)),
        (given["asterix"], lambda: _write_asterix(given["asterix"], found)),
        (given["output"], found.finish or (lambda: _write_tracks(given["output"], found.table))),
        (given["rates"], lambda: _write_rates(given["rates"], found.plots)),
        (given["report"], lambda: _write_report(given, found)),
        (given, lambda: _print_counts(given["output"], found, elapsed, compiling, given["check"])),
        (given["check"], lambda: print_lines(str(found.tracker.health))),
        (found.scene and found.scene.truth, lambda: _compare(found.scene, found.table, given["cutoff"] or CUTOFF)),
        (found.plots, lambda: _print_rates(found.plots, given["identity"])),
    )


def _write_map(path: str, tracks: TrackTable) -> None:
    from assoc.exports.maps import write_map

    write_map(path, tracks.to_frame())


def _write_asterix(path: str, found: Tracked) -> None:
    from assoc.integrations.asterix import write_tracks

    frame = found.table.to_frame()
    if found.table.identities:
        # aircraft with a transponder have heights by Mode C, if any sensor has heights by it
        mode_c = found.plots or any("height" in sensor.components[: sensor.dim] for sensor in found.tracker.sensors)
        frame["barometric"] = bool(mode_c) & ((frame["address_hex"] != "") | (frame["mode3_oct"] != ""))
    write_tracks(path, frame)


def _write_tracks(path: str, tracks: TrackTable) -> None:
    if TRACKS.ending(path) == ".parquet":
        tracks.to_parquet(path)
    else:
        tracks.to_csv(path)


def _write_report(given: Given, found: Tracked) -> None:
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


def _write_rates(path: str, plots: Judged) -> None:
    from assoc._files.output import write_text

    assert plots.rates is not None
    lines = ["window,time,plots,ct,mt,it"]
    for number_of, row in zip(plots.rates.windows.tolist(), plots.rates.per_window.tolist(), strict=True):
        cells = ["" if math.isnan(value) else f"{value:.2f}" for value in row]
        lines.append(f"{number_of + 1},{decimals(plots.ends[number_of], 6)},{plots.sizes[number_of]},{','.join(cells)}")
    write_text(path, "\n".join(lines) + "\n")


def _print_rates(plots: Judged, identity: str | None) -> None:
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


def _print_counts(output: str, found: Tracked, elapsed: float, compiling: float, check: bool) -> None:
    import numpy as np

    from assoc.tracking.filter_choice import height_note
    from assoc.tracking.target_kinds import slower_kind

    tracker, rows = found.tracker, found.table
    name = "stdout" if output == STDOUT else printable(output)
    count = len(rows.confirmed_ids())
    print_lines(f"{name}: {count} confirmed tracks, {len(rows)} rows, {found.num_tracked} scans")
    each = 1e3 * elapsed / max(found.num_tracked, 1)
    # several trackers never need the solver, or only for the rest of their own search
    used = tracker.settings.solver if tracker.solver_calls else "no solver used"
    spent = f"{elapsed:.2f} s, {each:.3g} ms a scan; {compiling:.2f} s more compiling"
    print_lines(f"{tracker.name}, {used}: {spent}")
    worst = sorted(rows.inconsistent().items(), key=lambda item: -item[1])
    if worst:
        shown = ", ".join(f"{track} ({nis:.2g})" for track, nis in worst[:5]) + (", ..." if len(worst) > 5 else "")
        print_lines(f"tracks that do not agree with their measurements (NIS, at most 1 expected): {shown}")
    note, health = height_note(tracker.sensors, len(tracker.filter.motion.position)), tracker.health
    if note is not None:
        print_lines(note)
    if health is not None and health.speed and not check:
        print_lines(health.speed)
    elif found.again is not None and len(rows) < _SHORT * max(count, 1):
        least = found.again(None) if count else 0.0
        slower = slower_kind(float(np.max(tracker.settings.initiation.speed)), found.again, least)
        if slower:
            what = "tracks are short" if count else "no track"
            print_lines(f"{what}: targets look slower than assumed: --targets {slower}")
        elif note is not None and found.tall and not count:
            print_lines("no track: where targets are low, 'heights = [lowest, highest]' in the description says so")


def _compare(scene: Scene, tracks: TrackTable, cutoff: float) -> None:
    """Print the metrics against the truth."""
    from assoc.metrics import Trajectories, summarise
    from assoc.tracking.track_table import against_truth

    compared = against_truth(scene, Trajectories(*tracks.arrays()))
    found, level = summarise(*compared, cutoff), ", horizontally" if compared[0].positions.shape[1] == 2 else ""
    print_lines(
        f"against the truth (cutoff {cutoff:g} m{level}): rms GOSPA {found.gospa:.4g} m "
        f"(localisation {found.gospa_localisation:.4g}, missed {found.gospa_missed:.4g}, "
        f"false {found.gospa_false:.4g}), {found.identity.switches} identity switches"
    )
