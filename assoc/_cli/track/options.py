"""The options of ``python -m assoc.track``: their parser, what is checked of them, and the tracker they ask for.

Imports inside functions keep --help quick.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.imports import HELP as IMPORT_HELP
from assoc._cli.imports import import_modules
from assoc._cli.inputs import check_ending, check_outputs
from assoc._cli.options import (
    add_common_options,
    common_values,
    flag_of,
    flags_of_solvers,
    parameter_values,
    read_first,
)
from assoc._cli.program import Parser, command
from assoc._cli.speech import add_speech_options
from assoc._cli.values import number, place_on_earth, whole_number
from assoc._parameters import Option, options, positive
from assoc._system.extras import check_extra
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.sensors import Sensor
    from assoc.tracking import Tracker

TRACKERS = {
    "multi-sensor": "one assignment over tracks and all sensors in each scan (default for scenes)",
    "static": "associates the sensors of a scan first, then assigns the results to tracks",
    "mht": "track-oriented multiple hypothesis tracking (default for plots)",
    "mht-hypothesis": "hypothesis-oriented multiple hypothesis tracking (Reid, Murty)",
    "nearest-neighbour": "assigns each measurement to the nearest track",
    "joint-probabilistic": "each track takes all measurements near it, by their probabilities (JIPDA)",
}
WINDOWS = ("ctw", "ctw-time", "irregular", "none")
IDENTITY = ("use", "score-only", "ignore")
# option -> the trackers that take it
_OWN = {
    "depth": ("mht", "mht-hypothesis"),
    "max_branches": ("mht",),
    "max_hypotheses": ("mht-hypothesis",),
    "max_events": ("joint-probabilistic",),
    "rule": ("nearest-neighbour",),
}
# option of the life cycle -> the choice without which it says nothing
_NEEDS = {
    "m": ("confirmation", "m-of-n"),
    "n": ("confirmation", "m-of-n"),
    "false_probability": ("confirmation", "score"),
    "deletion_time": ("deletion", "time"),
    "deletion_count": ("deletion", "count"),
    "deletion_drop": ("deletion", "score"),
}
# option -> what `assoc.recordings.radar_of` calls it, and its unit
RADAR = {
    "detection_probability": ("detection_probability", 1.0),
    "false_alarms": ("false_alarm_rate", 1.0),
    "range_noise": ("range_noise", 1.0),
    "bearing_noise": ("azimuth_noise", math.pi / 180.0),
}
FORMATS = {".csv": "to_csv", ".parquet": "to_parquet"}
"""Endings of the output, and which method of the table writes it."""

# options that only --live takes
LIVE_ONLY = ("udp", "replay", "page", "interval", "turns", "horizon", "wait")
CUTOFF = 1_000.0
# of the option groups: flag, what stands for its value, help
_OUTPUTS = (
    ("--map", "FILE", "write the tracks for a map as well (.geojson or .kml); needs an origin"),
    ("--origin", "LAT,LON[,H]", "where x = y = 0 is on the earth, degrees and metres (if not in FILE)"),
    ("--report", "FILE", "write an HTML page: tracks over time, metric, table (needs assoc[report])"),
)
_CHOICES = (
    ("--tracker", "NAME", "name of the tracker, see below"),
    ("--solver", "NAME", "name of the solver (default exact)"),
    (
        "--filter",
        "NAME",
        "imm-cv, ekf, kalman, modified-ekf, ukf, enkf, imm or fuzzy (default: imm-cv for scenes, ekf for plots)",
    ),
    ("--process-noise", "X", "process noise in m/s^1.5, for imm in m/s^2 (default 30, imm-cv by pace)"),
)
_TRACKING = (
    ("--depth", "N", "mht: number of scans after which a decision is final (default 3)"),
    ("--max-branches", "N", "mht: largest number of branches of a track tree (default 30)"),
    ("--max-hypotheses", "N", "mht-hypothesis: most hypotheses of a cluster (default 50)"),
    ("--max-events", "N", "joint-probabilistic: joint events kept apart at a time (default 4096)"),
    ("--rule", "NAME", "nearest-neighbour: greedy (default), or assignment, which uses the solver"),
    ("--import", "MODULE", IMPORT_HELP),
)
_PLOTS = (
    (
        "--window",
        "NAME",
        "how plots are grouped into scans: ctw, by antenna angle (default); ctw-time, by time; irregular, by random "
        "intervals; none, one by one",
    ),
    (
        "--identity",
        "NAME",
        "codes and addresses: use, to associate plots; score-only, to judge the tracks by them (default); or ignore",
    ),
    ("--rates", "FILE", "write CT, MT and IT of each window (.csv; needs identities)"),
    ("--rotation", "S", "rotation period of the antenna, seconds (default: estimated)"),
    ("--radar", "SAC/SIC", "which radar of an ASTERIX file (.ast, .asterix, .pcap)"),
    ("--detection-probability", "P", "detection probability of the radar (default 0.8)"),
    ("--range-noise", "M", "standard deviation of range, metres (default: from the plots' steps)"),
    ("--bearing-noise", "DEG", "standard deviation of bearing, degrees (default: likewise)"),
    ("--false-alarms", "X", "mean number of false plots in a rotation (default 2.5)"),
)
_PLOTS_AS_THEY_COME = (
    ("--udp", "PORT", "read them from this UDP port on 127.0.0.1 (default: stdin)"),
    ("--replay", "X", "take the scene's own plots, X times as quickly as they were made (0: at once)"),
    ("--page", "PORT", "show the picture moving on a page on 127.0.0.1 (0: any free port)"),
    ("--interval", "S", "seconds of plots that are taken in together (default 1)"),
    ("--turns", "S,...", "seconds for a turn of each radar's antenna (default: sensors look at once)"),
    ("--horizon", "S", "seconds that plots may be late (default 30)"),
    ("--wait", "S", "seconds for which an interval waits for plots (default 0)"),
)
_MORE = """
further options (docs/tracking.md):
  track life cycle   --confirmation --false-probability --missed-probability --m --n \
--deletion --deletion-time --deletion-count --deletion-drop
  track initiation   --speed --rest --birth-rate --widest
  --identity use     --code-garbled --code-shared --address-garbled --address-shared
  solver parameters  described by: python -m assoc.solve --solver NAME --help"""


def read_options(words: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the command line; the options, checked, and the arguments for the tracker.

    Raises
    ------
    InvalidInputError
        An option is unknown, or its value none that it takes.
    """
    first = read_first("assoc.track", words, ["solver", "import"])
    import_modules(first["import"])
    solver = first["solver"] or "exact"
    if {"-h", "--help"} & {*words}:
        # help must be quick, and the packages that know the further options are not
        _parser([]).parse_args(words)
    from assoc.tracking import IdentityParameters, Initiation, LifeCycle

    own, cycle, initiation, identity = _further(solver)
    parser = _parser([*own, *cycle, *initiation, *identity])
    parser.elsewhere = lambda: flags_of_solvers(solver)
    parsed = vars(parser.parse_args(words))
    given = parsed["cutoff"]
    if parsed["live"] and given is not None:
        raise InvalidInputError("--cutoff: is not for --live")
    parsed["cutoff"] = None if given is None else positive(number(given, "--cutoff"), "--cutoff")
    if not parsed["live"] and parsed["output"] is None:
        parser.error("the following arguments are required: -o/--output")
    check_outputs([parsed["output"], parsed["report"], parsed["map"], parsed["rates"]], [parsed["file"]])
    parsed["ending"] = check_ending(parsed["output"], "--output", *((".csv",) if parsed["live"] else FORMATS))
    check_ending(parsed["report"], "--report", ".html", ".htm", strict=False)
    check_ending(parsed["rates"], "--rates", ".csv", strict=False)
    if parsed["ending"] == ".parquet":
        check_extra("pyarrow", "parquet")
    if parsed["map"] and not parsed["map"].lower().endswith((".geojson", ".json", ".kml")):
        raise InvalidInputError(f"--map: expected a name that ends in .geojson or .kml, got {parsed['map']!r}")
    parsed["origin"] = None if parsed["origin"] is None else place_on_earth(parsed["origin"], "--origin")
    if parsed["report"]:
        check_extra("plotly", "report")
    lives = parameter_values(cycle, parsed)
    settings: dict[str, Any] = {
        "solver": solver,
        "solver_parameters": parameter_values(own, parsed),
        "life_cycle": LifeCycle(**lives),
        "initiation": Initiation(**parameter_values(initiation, parsed)),
        **common_values(parsed),
    }
    for name, (choice, needed) in _NEEDS.items():
        if name in lives and getattr(settings["life_cycle"], choice) != needed:
            raise InvalidInputError(f"{flag_of(name)}: is only for {flag_of(choice)} {needed}")
    if parsed["identity"] not in (None, *IDENTITY):
        raise InvalidInputError(f"--identity: unknown name {parsed['identity']!r}; known: {', '.join(IDENTITY)}")
    trusted = parameter_values(identity, parsed)
    if parsed["identity"] == "use":
        settings["identity"] = IdentityParameters(**trusted)
    elif trusted:
        raise InvalidInputError(f"{flag_of(next(iter(trusted)))}: is only for --identity use")
    if not parsed["live"]:
        for option in LIVE_ONLY:
            if parsed[option] is not None:
                raise InvalidInputError(f"{flag_of(option)}: is only for --live")
    return parsed, settings


def _further(solver: str) -> tuple[list[Option], list[Option], list[Option], list[Option]]:
    """Parameters of the solver, the life cycle of tracks, their initiation, and identities."""
    from assoc.solvers import registry
    from assoc.tracking import IdentityParameters, Initiation, LifeCycle

    initiation = [*options(Initiation), Option(Initiation, _field(Initiation, "speed"))]
    for one in initiation:
        one.kind = float
    return options(registry.parameters(solver)), options(LifeCycle), initiation, options(IdentityParameters)


def _field(owner: Any, name: str) -> Any:
    from dataclasses import fields

    return next(one for one in fields(owner) if one.name == name)


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    from assoc.solvers import registry
    from assoc.tracking.filter_choice import FILTERS

    values = {
        "--tracker": [*TRACKERS], "--filter": [*FILTERS], "--window": WINDOWS, "--identity": IDENTITY,
        "--solver": registry.names(),
    }  # fmt: skip
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
    _add(parser, _OUTPUTS)
    _add(parser, _CHOICES)
    add_common_options(parser, ["seed", "time_limit", "gate_probability"])
    text = f"GOSPA: farther than this from a target a track is false, metres (default {CUTOFF:g})"
    add("--cutoff", metavar="M", help=text)
    add("--registration", metavar="NAME", help="online: estimate biases of the scene's sensors and correct for them")
    add("--all", action="store_true", help="also write tracks that are tentative, or whose target may be gone")
    add("--smooth", action="store_true", help="smooth the tracks of a scene: each position by all of its measurements")
    _add(parser, _TRACKING)
    add_speech_options(parser, "the settings that were used")
    _add(parser.add_argument_group("options for plots"), _PLOTS)
    live = parser.add_argument_group("options for plots as they come")
    live.add_argument(
        "--live", action="store_true", help="read plots as lines (CSV or JSON), write tracks as they change"
    )
    _add(live, _PLOTS_AS_THEY_COME)
    for option in further:
        option.add_to(parser)
    return parser


def _add(group: argparse._ActionsContainer, table: Sequence[tuple[str, str, str]]) -> None:
    for flag, metavar, text in table:
        group.add_argument(flag, metavar=metavar, help=text)


def make_tracker(
    name: str,
    sensors: Sequence[Sensor],
    parsed: dict[str, Any],
    settings: dict[str, Any],
    region: Any,
    pace: float = 1.0,
) -> Tracker:
    """Make the tracker that the options ask for.

    Raises
    ------
    InvalidInputError
        There is no tracker of that name, or an option is not for it.
    """
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
