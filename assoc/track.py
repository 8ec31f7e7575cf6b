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

from assoc._cli.imports import HELP as IMPORT_HELP
from assoc._cli.imports import import_modules
from assoc._cli.inputs import check_ending, check_outputs
from assoc._cli.lines import print_lines
from assoc._cli.options import (
    add_common_options,
    common_values,
    flag_of,
    flags_of_solvers,
    parameter_values,
    read_first,
)
from assoc._cli.program import Parser, command, prepare_streams, run_program, write_all
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.scan_table import with_scan_table
from assoc._cli.signals import EarlyEnd, Interruption
from assoc._cli.speech import add_speech_options, spoken
from assoc._cli.values import number, place_on_earth, seconds, whole_number
from assoc._files.output import STDOUT
from assoc._parameters import Option, options, positive
from assoc._system.compile_time import compile_seconds
from assoc._system.extras import check_extra
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.recordings import Recording
    from assoc.scene.scene import Scene
    from assoc.sensors import Sensor
    from assoc.tracking import Tracker, TrackTable
    from assoc.tracking.plots.plot_tracks import PlotTracks

_INTERRUPTION = Interruption("assoc.track")
_EARLY_END = EarlyEnd("assoc.track")
# seconds that the scan under way gets when the program is asked to end: tracks are known between scans only
_LAST_SCAN = 20.0
TRACKERS = {
    "multi-sensor": "one assignment over tracks and all sensors in each scan (default for scenes)",
    "static": "associates the sensors of a scan first, then assigns the results to tracks",
    "mht": "track-oriented multiple hypothesis tracking (default for plots)",
    "mht-hypothesis": "hypothesis-oriented multiple hypothesis tracking (Reid, Murty)",
    "nearest-neighbour": "assigns each measurement to the nearest track",
    "joint-probabilistic": "each track takes all measurements near it, by their probabilities (JIPDA)",
}
WINDOWS = ("ctw", "ctw-time", "irregular", "none")
# option -> the trackers that take it
_OWN = {
    "depth": ("mht", "mht-hypothesis"),
    "max_branches": ("mht",),
    "max_hypotheses": ("mht-hypothesis",),
    "max_events": ("joint-probabilistic",),
    "rule": ("nearest-neighbour",),
}
# option -> what `assoc.recordings.radar_of` calls it, and its unit
_RADAR = {
    "detection_probability": ("detection_probability", 1.0),
    "false_alarms": ("false_alarm_rate", 1.0),
    "range_noise": ("range_noise", 1.0),
    "bearing_noise": ("azimuth_noise", math.pi / 180.0),
}
FORMATS = {".csv": "to_csv", ".parquet": "to_parquet"}
"""Endings of the output, and which method of the table writes it."""

# options that only --live takes
_LIVE = ("udp", "replay", "page", "interval", "turns", "horizon", "wait")
CUTOFF = 1_000.0
_MORE = """
further options (docs/tracking.md):
  track life cycle   --confirmation --false-probability --missed-probability --m --n \
--deletion --deletion-time --deletion-count --deletion-drop
  track initiation   --speed --rest --birth-rate --widest
  solver parameters  described by: python -m assoc.solve --solver NAME --help"""


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
    return run_program(lambda: _track(words), "assoc.track")


def _track(words: list[str]) -> None:
    first = read_first("assoc.track", words, ["solver", "import"])
    import_modules(first["import"])
    solver = first["solver"] or "exact"
    if {"-h", "--help"} & {*words}:
        # help must be quick, and the packages that know the further options are not
        _parser([]).parse_args(words)
    from assoc.tracking import Initiation, LifeCycle

    own, cycle, initiation = _further(solver)
    parser = _parser([*own, *cycle, *initiation])
    parser.elsewhere = lambda: flags_of_solvers(solver)
    parsed = vars(parser.parse_args(words))
    given = parsed["cutoff"]
    parsed["cutoff"] = CUTOFF if given is None else positive(number(given, "--cutoff"), "--cutoff")
    if not parsed["live"] and parsed["output"] is None:
        parser.error("the following arguments are required: -o/--output")
    check_outputs([parsed["output"], parsed["report"], parsed["map"], parsed["rates"]], [parsed["file"]])
    ending = check_ending(parsed["output"], "--output", *FORMATS)
    check_ending(parsed["report"], "--report", ".html", ".htm", strict=False)
    check_ending(parsed["rates"], "--rates", ".csv", strict=False)
    if ending == ".parquet":
        check_extra("pyarrow", "parquet")
    if parsed["map"] and not parsed["map"].lower().endswith((".geojson", ".json", ".kml")):
        raise InvalidInputError(f"--map: expected a name that ends in .geojson or .kml, got {parsed['map']!r}")
    parsed["origin"] = None if parsed["origin"] is None else place_on_earth(parsed["origin"], "--origin")
    if parsed["report"]:
        check_extra("plotly", "report")
    settings: dict[str, Any] = {
        "solver": solver,
        "solver_parameters": parameter_values(own, parsed),
        "life_cycle": LifeCycle(**parameter_values(cycle, parsed)),
        "initiation": Initiation(**parameter_values(initiation, parsed)),
        **common_values(parsed),
    }
    if parsed["live"]:
        _live(parsed["file"], parsed, settings)
        return
    for option in _LIVE:
        if parsed[option] is not None:
            raise InvalidInputError(f"{flag_of(option)}: is only for --live")
    with spoken(quiet=parsed["quiet"], outputs=[parsed["output"], parsed["report"], parsed["rates"], parsed["map"]]):
        _make_tracks(words, parsed, settings, ending)


def _make_tracks(words: list[str], parsed: dict[str, Any], settings: dict[str, Any], ending: str) -> None:
    file = parsed["file"]
    started, compiled = time.perf_counter(), compile_seconds()
    if _is_npz(file):
        if parsed["window"] is not None:
            raise InvalidInputError("--window: groups the plots of a CSV file; a scene already has scans")
        tracker, table, scene, total = _of_scene(file, parsed, settings)
        count, plots = scene.num_scans, None
    else:
        tracker, plots, total = _of_plots(file, parsed, settings)
        count, table, scene = len(plots.windows), plots.table, None
        table.origin = parsed["origin"]
    compiling = compile_seconds() - compiled
    elapsed = time.perf_counter() - started - compiling

    def write_report() -> None:
        if parsed["report"]:
            from assoc.plotting.report import write_tracking_report

            asked = tracker.solver if tracker.solver_calls else "none"
            used = {"tracker": tracker.name, "solver": asked, "filter": parsed["filter"], "scans": count}
            more: dict[str, Any] = {"name": file, "settings": used, "cutoff": parsed["cutoff"], "words": words}
            more["plots"] = plots
            write_tracking_report(parsed["report"], table.to_frame(), scene, **more)

    def write_tracks_on_map() -> None:
        if parsed["map"]:
            from assoc.tracking.maps import write_map

            write_map(parsed["map"], table.to_frame())

    def write_rates() -> None:
        if parsed["rates"] and plots is not None:
            _write_rates(parsed["rates"], plots)

    if parsed["verbose"]:
        print_lines(", ".join(f"{name} {value}" for name, value in settings.items()))
    write_all(
        write_tracks_on_map,
        lambda: getattr(table, FORMATS[ending])(parsed["output"]),
        write_rates,
        write_report,
        lambda: _report(parsed["output"], count, tracker, table, elapsed, compiling),
        lambda: _compare(scene, table, parsed["cutoff"]),
        lambda: _report_rates(plots),
    )
    _EARLY_END.say(f"the tracks of {count} of {total} scans are written")


def _further(solver: str) -> tuple[list[Option], list[Option], list[Option]]:
    """Parameters of the solver, the life cycle of tracks, and their initiation."""
    from assoc.solvers import registry
    from assoc.tracking import Initiation, LifeCycle

    initiation = [*options(Initiation), Option(Initiation, _field(Initiation, "speed"))]
    for one in initiation:
        one.kind = float
    return options(registry.parameters(solver)), options(LifeCycle), initiation


def _field(owner: Any, name: str) -> Any:
    from dataclasses import fields

    return next(one for one in fields(owner) if one.name == name)


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    from assoc.solvers import registry
    from assoc.tracking.filter_choice import FILTERS

    values = {"--tracker": [*TRACKERS], "--filter": [*FILTERS], "--window": WINDOWS, "--solver": registry.names()}
    return {**_parser([option for group in _further("exact") for option in group]).flags(), **values}


def _parser(further: Sequence[Option]) -> Parser:
    lines = [f"  {name:<18} {purpose}" for name, purpose in TRACKERS.items()]
    called = command("track")
    parser = Parser(
        prog="assoc.track",
        usage=f"{called} FILE [--tracker NAME] [--solver NAME] [--filter NAME] -o tracks.csv [options]\n"
        f"       {called} SCENE --live [--udp PORT] [--page PORT] [options] < plots",
        description="Make tracks from the measurements of a scene (.npz) or from radar plots (.csv).",
        epilog="trackers:\n" + "\n".join(lines) + "\n" + _MORE,
    )
    add = parser.add_argument
    add("file", metavar="FILE", help="scene.npz, or plots.csv with time, range, bearing (docs/recordings.md)")
    add("-o", "--output", metavar="FILE", help="file for the tracks (.csv or .parquet)")
    add("--map", metavar="FILE", help="write the tracks for a map as well (.geojson or .kml); needs an origin")
    add("--origin", metavar="LAT,LON[,H]", help="where x = y = 0 is on the earth, degrees and metres (if not in FILE)")
    add("--report", metavar="FILE", help="write an HTML page: tracks over time, metric, table (needs assoc[report])")
    add("--tracker", metavar="NAME", help="name of the tracker, see below")
    add("--solver", metavar="NAME", help="name of the solver (default exact)")
    add(
        "--filter",
        metavar="NAME",
        help="imm-cv, ekf, kalman, modified-ekf, ukf, enkf, imm or fuzzy (default: imm-cv for scenes, ekf for plots)",
    )
    add("--process-noise", metavar="X", help="process noise in m/s^1.5, for imm in m/s^2 (default 30, imm-cv by pace)")
    add_common_options(parser, ["seed", "time_limit", "gate_probability"])
    text = f"GOSPA: farther than this from a target a track is false, metres (default {CUTOFF:g})"
    add("--cutoff", metavar="M", help=text)
    add("--registration", metavar="NAME", help="online: estimate biases of the scene's sensors and correct for them")
    add("--all", action="store_true", help="also write tracks that are tentative, or whose target may be gone")
    add("--smooth", action="store_true", help="smooth the tracks of a scene: each position by all of its measurements")
    add("--depth", metavar="N", help="mht: number of scans after which a decision is final (default 3)")
    add("--max-branches", metavar="N", help="mht: largest number of branches of a track tree (default 30)")
    add("--max-hypotheses", metavar="N", help="mht-hypothesis: largest number of hypotheses (default 20)")
    add("--max-events", metavar="N", help="joint-probabilistic: joint events listed for each cluster (default 100)")
    add("--rule", metavar="NAME", help="nearest-neighbour: greedy (default), or assignment, which uses the solver")
    add("--import", metavar="MODULE", help=IMPORT_HELP)
    add_speech_options(parser, "the settings that were used")
    plots = parser.add_argument_group("options for plots")
    plots.add_argument(
        "--window",
        metavar="NAME",
        help="how plots are grouped into scans: ctw, by antenna angle (default); ctw-time, by time; irregular, by "
        "random intervals; none, one by one",
    )
    plots.add_argument("--rates", metavar="FILE", help="write CT, MT and IT of each window (.csv; needs identities)")
    plots.add_argument("--rotation", metavar="S", help="rotation period of the antenna, seconds (default: estimated)")
    add = plots.add_argument
    add("--radar", metavar="SAC/SIC", help="which radar of an ASTERIX file (.ast, .asterix, .pcap)")
    add("--detection-probability", metavar="P", help="detection probability of the radar (default 0.8)")
    add("--range-noise", metavar="M", help="standard deviation of range, metres (default: from the plots' steps)")
    add("--bearing-noise", metavar="DEG", help="standard deviation of bearing, degrees (default: likewise)")
    add("--false-alarms", metavar="X", help="mean number of false plots in a rotation (default 2.5)")
    live = parser.add_argument_group("options for plots as they come")
    add = live.add_argument
    add("--live", action="store_true", help="read plots as lines (CSV or JSON), write tracks as they change")
    add("--udp", metavar="PORT", help="read them from this UDP port on 127.0.0.1 (default: stdin)")
    add("--replay", metavar="X", help="take the scene's own plots, X times as quickly as they were made (0: at once)")
    add("--page", metavar="PORT", help="show the picture moving on a page on 127.0.0.1 (0: any free port)")
    add("--interval", metavar="S", help="seconds of plots that are taken in together (default 1)")
    add("--turns", metavar="S,...", help="seconds for a turn of each radar's antenna (default: sensors look at once)")
    add("--horizon", metavar="S", help="seconds that plots may be late (default 30)")
    add("--wait", metavar="S", help="seconds for which an interval waits for plots (default 0)")
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


def _make(
    name: str, sensors: Sequence[Sensor], parsed: dict[str, Any], settings: dict[str, Any], region: Any,
    pace: float = 1.0,
) -> Tracker:
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
        extra[option] = parsed[option] if option == "rule" else whole_number(parsed[option], flag, 1)
    noise = None
    if parsed["process_noise"] is not None:
        noise = positive(number(parsed["process_noise"], "--process-noise"), "--process-noise", zero=True)
    made = make_filter(parsed["filter"], sensors, noise, settings.get("seed", 0), pace)
    return KINDS[name](sensors, made, region=region, **settings, **extra)


def _of_scene(
    file: str, parsed: dict[str, Any], settings: dict[str, Any]
) -> tuple[Tracker, TrackTable, Scene, int]:
    """The tracker, its tracks, the scene as far as it was tracked, and how many scans it has in all."""
    from assoc.scene.scene import Scene
    from assoc.tracking import smoothed, track_scene
    from assoc.tracking.filter_choice import pace_of

    parsed["filter"] = parsed["filter"] or "imm-cv"
    if parsed["rates"] is not None:
        raise InvalidInputError("--rates: judges the plots of a CSV file; a scene with its truth is judged by GOSPA")
    for flag in ("rotation", *_RADAR):
        if parsed[flag] is not None:
            raise InvalidInputError(f"{flag_of(flag)}: describes the radar of plots; a scene contains its own sensors")
    if parsed["registration"] is not None:
        if parsed["registration"] != "online":
            raise InvalidInputError(f"--registration: expected online, got {parsed['registration']!r}")
        settings["registration"] = "online"
    scene = Scene.load(file)
    if parsed["origin"] is not None:
        scene = replace(scene, origin=parsed["origin"])
    elif parsed["map"] and scene.origin is None:
        raise InvalidInputError(f"--map: {file} does not say where it is on the earth; give --origin LAT,LON")
    name, pace = parsed["tracker"] or "multi-sensor", pace_of(scene.times)
    tracker = _make(name, scene.sensors, parsed, settings, scene.region, pace)
    bar = ProgressBar("tracking", "scans", shown=not parsed["quiet"])
    numbers = with_progress(range(scene.num_scans), scene.num_scans, bar)
    numbers = with_scan_table(numbers, tracker, lambda k: (scene.times[k], scene.scan(k).sizes.tolist()))
    with _EARLY_END.work(_LAST_SCAN):
        table, decisions = track_scene(tracker, scene, confirmed=not parsed["all"], scans=numbers)
    if parsed["smooth"]:
        table = smoothed(tracker, scene, decisions)
    tracked = scene if bar.done == scene.num_scans else scene.part(0, bar.done)
    return tracker, table, tracked, scene.num_scans


def _of_plots(file: str, parsed: dict[str, Any], settings: dict[str, Any]) -> tuple[Tracker, PlotTracks, int]:
    import numpy as np

    from assoc.recordings import Window, clustering_time_window, irregular_groups, radar_of, read_plots
    from assoc.tracking.plots.plot_tracks import track_plots

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
    for flag, (argument, unit) in _RADAR.items():
        if parsed[flag] is not None:
            radar[argument] = unit * number(parsed[flag], flag_of(flag))
    turn = None if parsed["rotation"] is None else seconds(parsed["rotation"], "--rotation")
    if parsed["smooth"]:
        raise InvalidInputError("--smooth: is for scenes (.npz), not for plots")
    recording = _read_asterix(file, parsed["radar"]) if _is_asterix(file) else read_plots(file)
    if parsed["radar"] is not None and not _is_asterix(file):
        raise InvalidInputError("--radar: names a radar of an ASTERIX file; a table holds the plots of one")
    if parsed["rates"] and recording.aircraft is None:
        raise InvalidInputError(f"--rates: {file}: no plot has an identity (column mode3 or aircraft)")
    if window == "none":
        windows = [Window.of(recording, [row], row) for row in range(len(recording))]  # type: ignore[arg-type]
    elif window == "irregular":
        windows = irregular_groups(recording, np.random.default_rng(settings.get("seed", 0)))
    else:
        windows = clustering_time_window(recording, turn, by="antenna" if window == "ctw" else "time")
    print_lines(recording.summary())
    tracker = _make(name, [radar_of(recording, **radar)], parsed, settings, None)
    if parsed["map"] and parsed["origin"] is None:
        raise InvalidInputError("--map: plots do not say where their radar stands; give --origin LAT,LON")
    shown = with_progress(windows, len(windows), ProgressBar("tracking", "scans", shown=not parsed["quiet"]))
    shown = with_scan_table(shown, tracker, lambda window: (window.times[-1], [len(window)]))
    with _EARLY_END.work(_LAST_SCAN):
        done = track_plots(tracker, recording, shown, confirmed=not parsed["all"])
    return tracker, done, len(windows)


def _write_rates(path: str, plots: PlotTracks) -> None:
    from assoc._files.output import write_text

    assert plots.rates is not None
    lines = ["window,time,plots,ct,mt,it"]
    for number_of, row in zip(plots.rates.windows.tolist(), plots.rates.per_window.tolist(), strict=True):
        cells = ["" if math.isnan(value) else f"{value:.2f}" for value in row]
        lines.append(f"{number_of + 1},{plots.ends[number_of]:g},{len(plots.windows[number_of])},{','.join(cells)}")
    write_text(path, "\n".join(lines) + "\n")


def _report_rates(plots: PlotTracks | None) -> None:
    if plots is None or plots.rates is None:
        return
    rates, known = plots.rates, "aircraft" if plots.recording.sources is not None else "Mode 3"
    figures = ", ".join(
        f"{name} {'-' if math.isnan(value) else f'{value:.1f} %'}"
        for name, value in (("CT", rates.ct), ("MT", rates.mt), ("IT", rates.it))
    )
    print_lines(f"{figures}: means over {len(rates.windows)} windows, aircraft known by {known} (docs/metrics.md)")


def _live(file: str, parsed: dict[str, Any], settings: dict[str, Any]) -> None:
    """Track plots as they come, until they end or a signal ends the program."""
    from assoc._cli.live import Lines, TrackWriter, parse_line, replayed
    from assoc.scene.scene import Scene
    from assoc.tracking import LiveTracker

    for flag in ("report", "rates", "window", "rotation", "registration", *_RADAR):
        if parsed[flag] is not None:
            raise InvalidInputError(f"{flag_of(flag)}: is not for --live")
    if parsed["smooth"]:
        raise InvalidInputError("--smooth: is for finished tracks, not for --live")
    if parsed["udp"] is not None and parsed["replay"] is not None:
        raise InvalidInputError("--udp and --replay: expected one of them")
    parsed["filter"] = parsed["filter"] or "imm-cv"
    given = [name for name in ("interval", "horizon", "wait") if parsed[name] is not None]
    numbers = {name: number(parsed[name], flag_of(name)) for name in given}
    turns = None if parsed["turns"] is None else [number(one, "--turns") for one in parsed["turns"].split(",")]
    ports = {
        name: None if parsed[name] is None else whole_number(parsed[name], flag_of(name), 0) for name in ("udp", "page")
    }
    speed = None if parsed["replay"] is None else number(parsed["replay"], "--replay")
    if speed is not None and not 0 <= speed < math.inf:
        raise InvalidInputError(f"--replay: expected a number >= 0, got {parsed['replay']!r}")
    scene = Scene.load(file)

    def tell(line: str) -> None:
        print(f"assoc.track: {printable(line)}", file=sys.stderr, flush=True)

    def make() -> Tracker:
        return _make(parsed["tracker"] or "multi-sensor", scene.sensors, parsed, settings, scene.region)

    tracker = LiveTracker(scene, make, turns=turns, tell=tell, **numbers)
    tracker.warm_up()
    page = None
    if ports["page"] is not None:
        from assoc.plotting.live import LivePage

        page = LivePage(scene, ports["page"], scene.name)
        tell(f"page: {page.address}")
    lines = None if speed is not None else Lines(ports["udp"])
    if lines is not None and lines.port is not None:
        tell(f"plots: udp 127.0.0.1:{lines.port}")
    kept = parsed["output"] not in (None, "-")
    stream = open(parsed["output"], "w", encoding="utf-8", newline="\n") if kept else sys.stdout
    writer = TrackWriter(stream, tracker.positions)

    def show(pictures: list[Any]) -> None:
        for picture in pictures:
            writer.write(picture)
            if page is not None:
                page.show(picture)

    def end() -> None:
        show(tracker.finish())
        if page is not None:
            page.close()
        if kept:
            stream.close()
        if lines is not None and lines.lost:
            tell(f"{lines.lost} lines lost: they came quicker than tracks can be made")
        tell(tracker.summary())

    with _INTERRUPTION.reported(end):
        if lines is None:
            for plot in replayed(scene, speed or 0.0):
                show(tracker.take(*plot))
        else:
            for line in lines:
                try:
                    found = parse_line(line, scene)
                except InvalidInputError as error:
                    tracker.leave_out("lines not understood", f"line left out: {error}")
                    continue
                if found is not None:
                    show(tracker.take(*found))
    end()


def _report(
    output: str, count: int, tracker: Tracker, table: TrackTable, elapsed: float, compiling: float
) -> None:
    _, ids, _ = table.arrays()
    name = "stdout" if output == STDOUT else printable(output)
    print_lines(f"{name}: {len(set(ids.tolist()))} confirmed tracks, {len(table)} rows, {count} scans")
    each = 1e3 * elapsed / max(count, 1)
    # several trackers never need one, or only for what their own search leaves open
    used = tracker.solver if tracker.solver_calls else "no solver used"
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
