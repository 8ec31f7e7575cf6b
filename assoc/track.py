"""``python -m assoc.track``: tracks from a scene, or from the radar plots of a CSV file.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import check_outputs
from assoc._cli.lines import print_lines
from assoc._cli.options import add_common_options, common_values, flag_of, parameter_values, read_first
from assoc._cli.program import Parser, prepare_process, run_program, write_all
from assoc._cli.progress import with_progress
from assoc._cli.values import number, seconds, whole_number
from assoc._parameters import Option, options
from assoc._system.compile_time import compile_seconds
from assoc._system.extras import check_extra
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.scene.scene import Scene
    from assoc.sensors import Sensor
    from assoc.tracking import Tracker, TrackTable

TRACKERS = {
    "multi-sensor": "one assignment over tracks and all sensors in each scan (default for scenes)",
    "static": "associates the sensors of a scan first, then assigns the results to tracks",
    "mht": "track-oriented multiple hypothesis tracking (default for plots)",
    "mht-hypothesis": "hypothesis-oriented multiple hypothesis tracking (Reid, Murty)",
    "nearest-neighbour": "assigns each measurement to the nearest track",
}
WINDOWS = ("ctw", "ctw-time", "none")
# option -> the trackers that take it
_OWN = {
    "depth": ("mht", "mht-hypothesis"),
    "max_branches": ("mht",),
    "max_hypotheses": ("mht-hypothesis",),
}
# option -> what `assoc.recordings.radar_of` calls it, and its unit
_RADAR = {
    "detection_probability": ("detection_probability", 1.0),
    "false_alarms": ("false_alarm_rate", 1.0),
    "range_noise": ("range_noise", 1.0),
    "bearing_noise": ("azimuth_noise", math.pi / 180.0),
}
GOSPA_CUTOFF = 1_000.0
_MORE = """
further options (docs/tracking.md):
  track life cycle   --confirmation --false-probability --missed-probability --m --n \
--deletion --deletion-time --deletion-count --deletion-drop
  track initiation   --speed --rest --birth-rate --widest
  solver parameters  described by: python -m assoc.solve --solver NAME --help"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _track(words), "assoc.track")


def _track(words: list[str]) -> None:
    solver = read_first("assoc.track", words, ["solver"])["solver"] or "exact"
    if {"-h", "--help"} & {*words}:
        # help must be quick, and the packages that know the further options are not
        _parser([]).parse_args(words)
    from assoc.solvers import registry
    from assoc.tracking import Initiation, LifeCycle

    own = options(registry.parameters(solver))
    cycle, start = options(LifeCycle), [*options(Initiation), Option(Initiation, _field(Initiation, "speed"))]
    for one in start:
        one.kind = float
    parsed = vars(_parser([*own, *cycle, *start]).parse_args(words))
    file = parsed["file"]
    check_outputs([parsed["output"], parsed["report"]], [file])
    if parsed["report"]:
        check_extra("plotly", "report")
    settings: dict[str, Any] = {
        "solver": solver,
        "solver_parameters": parameter_values(own, parsed),
        "life_cycle": LifeCycle(**parameter_values(cycle, parsed)),
        "initiation": Initiation(**parameter_values(start, parsed)),
        **common_values(parsed),
    }
    started, compiled = time.perf_counter(), compile_seconds()
    if _is_npz(file):
        if parsed["window"] is not None:
            raise InvalidInputError("--window: groups the plots of a CSV file; a scene already has scans")
        count, tracker, table, scene = _of_scene(file, parsed, settings)
    else:
        count, tracker, table, scene = _of_plots(file, parsed, settings)
    compiling = compile_seconds() - compiled
    elapsed = time.perf_counter() - started - compiling

    def write_report() -> None:
        if parsed["report"]:
            from assoc.plotting.report import write_tracking_report

            used = {"tracker": tracker.name, "solver": solver, "filter": parsed["filter"], "scans": count}
            more: dict[str, Any] = {"name": file, "settings": used, "cutoff": GOSPA_CUTOFF, "words": words}
            write_tracking_report(parsed["report"], table.to_frame(), scene, **more)

    write_all(
        lambda: table.to_csv(parsed["output"]),
        write_report,
        lambda: _report(parsed["output"], count, tracker, table, scene, elapsed, compiling),
    )


def _field(owner: Any, name: str) -> Any:
    from dataclasses import fields

    return next(one for one in fields(owner) if one.name == name)


def _parser(further: Sequence[Option]) -> Parser:
    lines = [f"  {name:<18} {purpose}" for name, purpose in TRACKERS.items()]
    parser = Parser(
        prog="assoc.track",
        usage="python -m assoc.track FILE [--tracker NAME] [--solver NAME] [--filter NAME] -o tracks.csv [options]",
        description="Make tracks from the measurements of a scene (.npz) or from radar plots (.csv).",
        epilog="trackers:\n" + "\n".join(lines) + "\n" + _MORE,
    )
    add = parser.add_argument
    add("file", metavar="FILE", help="scene.npz, or plots.csv with time, range, bearing (docs/recordings.md)")
    add("-o", "--output", required=True, metavar="FILE", help="file for the tracks (.csv)")
    add("--report", metavar="FILE", help="write an HTML page: tracks over time, metric, table (needs assoc[report])")
    add("--tracker", metavar="NAME", help="name of the tracker, see below")
    add("--solver", metavar="NAME", help="name of the solver (default exact)")
    add(
        "--filter",
        metavar="NAME",
        help="imm-cv, ekf, kalman, modified-ekf, ukf, enkf, imm or fuzzy (default: imm-cv for scenes, ekf for plots)",
    )
    add("--process-noise", metavar="X", help="process noise in m/s^1.5, for imm in m/s^2 (default 30, imm-cv 50)")
    add_common_options(parser, ["seed", "time_limit", "gate_probability"])
    add("--registration", metavar="NAME", help="online: estimate biases of the scene's sensors and correct for them")
    add("--all", action="store_true", help="also write tentative tracks")
    add("--depth", metavar="N", help="mht: number of scans after which a decision is final (default 3)")
    add("--max-branches", metavar="N", help="mht: largest number of branches of a track tree (default 30)")
    add("--max-hypotheses", metavar="N", help="mht-hypothesis: largest number of hypotheses (default 20)")
    plots = parser.add_argument_group("options for plots")
    plots.add_argument(
        "--window",
        metavar="NAME",
        help="how plots are grouped into scans: ctw, by antenna angle (default); ctw-time, by time; none, one by one",
    )
    plots.add_argument("--rotation", metavar="S", help="rotation period of the antenna, seconds (default: estimated)")
    add = plots.add_argument
    add("--detection-probability", metavar="P", help="detection probability of the radar (default 0.8)")
    add("--range-noise", metavar="M", help="standard deviation of range, metres (default: from the plots' steps)")
    add("--bearing-noise", metavar="DEG", help="standard deviation of bearing, degrees (default: likewise)")
    add("--false-alarms", metavar="X", help="mean number of false plots in a rotation (default 2.5)")
    for option in further:
        option.add_to(parser)
    return parser


def _is_npz(file: str) -> bool:
    """Whether a file is meant as a scene: by its first bytes, or by its name where it cannot be read."""
    try:
        with open(file, "rb") as stream:
            start = stream.read(4)
    except OSError:
        return not file.lower().endswith(".csv")
    return start == b"PK\x03\x04" or file.lower().endswith(".npz")


def _make(
    name: str, sensors: Sequence[Sensor], parsed: dict[str, Any], settings: dict[str, Any], region: Any
) -> Tracker:
    from assoc._parameters import positive
    from assoc.tracking import TRACKERS as KINDS
    from assoc.tracking.filter_choice import make_filter

    if name not in KINDS:
        raise InvalidInputError(f"--tracker: unknown name {name!r}; known: {', '.join(KINDS)}")
    extra: dict[str, Any] = {}
    for option, takers in _OWN.items():
        if parsed[option] is None:
            continue
        flag = flag_of(option)
        if name not in takers:
            raise InvalidInputError(f"{flag}: is only for --tracker {' or '.join(takers)}, not for {name}")
        extra[option] = whole_number(parsed[option], flag, 1)
    noise = None
    if parsed["process_noise"] is not None:
        noise = positive(number(parsed["process_noise"], "--process-noise"), "--process-noise", zero=True)
    made = make_filter(parsed["filter"], sensors, noise, settings.get("seed", 0))
    return KINDS[name](sensors, made, region=region, **settings, **extra)


def _of_scene(
    file: str, parsed: dict[str, Any], settings: dict[str, Any]
) -> tuple[int, Tracker, TrackTable, Scene | None]:
    from assoc.scene.scene import Scene
    from assoc.tracking import track_scene

    parsed["filter"] = parsed["filter"] or "imm-cv"
    for flag in ("rotation", *_RADAR):
        if parsed[flag] is not None:
            raise InvalidInputError(f"{flag_of(flag)}: describes the radar of plots; a scene contains its own sensors")
    if parsed["registration"] is not None:
        if parsed["registration"] != "online":
            raise InvalidInputError(f"--registration: expected online, got {parsed['registration']!r}")
        settings["registration"] = "online"
    scene = Scene.load(file)
    tracker = _make(parsed["tracker"] or "multi-sensor", scene.sensors, parsed, settings, scene.region)
    numbers = with_progress(range(scene.num_scans), scene.num_scans, "tracking")
    table, _ = track_scene(tracker, scene, confirmed=not parsed["all"], scans=numbers)
    return scene.num_scans, tracker, table, scene


def _of_plots(
    file: str, parsed: dict[str, Any], settings: dict[str, Any]
) -> tuple[int, Tracker, TrackTable, Scene | None]:
    from assoc.recordings import Window, clustering_time_window, radar_of, read_plots
    from assoc.tracking import TrackTable
    from assoc.tracking.plot_windows import step_windows

    if parsed["registration"] is not None:
        raise InvalidInputError("--registration: biases of one radar alone cannot be observed; it is for scenes")
    name = parsed["tracker"] or "mht"
    parsed["filter"] = parsed["filter"] or "ekf"
    if name in ("multi-sensor", "static"):
        raise InvalidInputError(
            f"--tracker: {name} takes scenes; for plots use mht, mht-hypothesis or nearest-neighbour"
        )
    window = parsed["window"] or "ctw"
    if window not in WINDOWS:
        raise InvalidInputError(f"--window: unknown name {window!r}; known: {', '.join(WINDOWS)}")
    radar: dict[str, Any] = {}
    for flag, (argument, unit) in _RADAR.items():
        if parsed[flag] is not None:
            radar[argument] = unit * number(parsed[flag], flag_of(flag))
    turn = None if parsed["rotation"] is None else seconds(parsed["rotation"], "--rotation")
    recording = read_plots(file)
    if window == "none":
        windows = [Window.of(recording, [row], row) for row in range(len(recording))]  # type: ignore[arg-type]
    else:
        windows = clustering_time_window(recording, turn, by="antenna" if window == "ctw" else "time")
    print_lines(recording.summary())
    tracker = _make(name, [radar_of(recording, **radar)], parsed, settings, None)
    table = TrackTable()
    for _ in step_windows(tracker, with_progress(windows, len(windows), "tracking")):
        tracks = (track for track in tracker.tracks if track.confirmed or parsed["all"])
        table.add(tracks, tracker.filter.motion.position)
    return len(windows), tracker, table, None


def _report(
    output: str, count: int, tracker: Tracker, table: TrackTable, scene: Scene | None, elapsed: float, compiling: float
) -> None:
    _, ids, _ = table.arrays()
    print_lines(f"{printable(output)}: {len(set(ids.tolist()))} confirmed tracks, {len(table)} rows, {count} scans")
    each = 1e3 * elapsed / max(count, 1)
    spent = f"{elapsed:.2f} s, {each:.3g} ms a scan; {compiling:.2f} s more compiling"
    print_lines(f"{tracker.name}, {tracker.solver}: {spent}")
    if scene is None or scene.truth is None:
        return
    from assoc.metrics import Trajectories, summarise

    found = summarise(Trajectories.from_scene(scene), Trajectories(*table.arrays()), GOSPA_CUTOFF)
    print_lines(
        f"against the truth (cutoff {GOSPA_CUTOFF:g} m): GOSPA {found.gospa:.4g} m "
        f"(localisation {found.gospa_localisation:.4g}, missed {found.gospa_missed:.4g}, "
        f"false {found.gospa_false:.4g}), "
        f"{found.identity.switches} identity switches"
    )


if __name__ == "__main__":
    prepare_process("assoc.track")
    raise SystemExit(main())
