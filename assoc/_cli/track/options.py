"""The options of ``assoc track`` and ``assoc live``, and the tracker that they describe.

Imports inside functions keep --help quick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from assoc._cli import values as kinds
from assoc._cli.inputs import import_modules
from assoc._cli.options import (
    COMMON,
    Given,
    Option,
    Parser,
    flag_of,
    flags_of_solvers,
    parameter_options,
    read_first,
    verbosity,
)
from assoc._cli.program import command
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc._types import Array
    from assoc.scene.scene import Scene
    from assoc.sensors import Sensor
    from assoc.tracking import Initiation, Tracker

TRACKERS = {
    "multi-sensor": "one assignment over tracks and all sensors in each scan (default for scenes)",
    "static": "associates the sensors of a scan first, then assigns the results to tracks",
    "mht": "track-oriented multiple hypothesis tracking (default for plots)",
    "mht-hypothesis": "hypothesis-oriented multiple hypothesis tracking (Reid, Murty)",
    "nearest-neighbour": "assigns each measurement to the nearest track",
    "joint-probabilistic": "each track takes all measurements near it, by their probabilities (JIPDA)",
}
_GNN = "gnn"
_ALIASES = {
    "jpda": "joint-probabilistic", "jipda": "joint-probabilistic", "tomht": "mht", "homht": "mht-hypothesis",
    "nn": "nearest-neighbour", _GNN: "nearest-neighbour",
}  # fmt: skip
"""What else trackers are called."""
TARGETS = ("airliner", "fighter", "ship", "drone", "pedestrian", "missile", "ballistic", "satellite")
FILTERS = ("imm-cv", "ekf", "kalman", "modified-ekf", "ukf", "enkf", "imm", "fuzzy")

_OF_TRACKERS = (
    Option("depth", "N", "mht: number of scans after which a decision is final (default 3)", kinds.whole(1),
           {"tracker": ("mht", "mht-hypothesis")}),
    Option("max_branches", "N", "mht: largest number of branches of a track tree (default 30)", kinds.whole(1),
           {"tracker": ("mht",)}),
    Option("max_hypotheses", "N", "mht-hypothesis: most hypotheses of a cluster (default 50)", kinds.whole(1),
           {"tracker": ("mht-hypothesis",)}),
    Option("max_events", "N", "joint-probabilistic: joint events kept apart at a time (default 4096)", kinds.whole(1),
           {"tracker": ("joint-probabilistic",)}),
    Option("rule", "NAME", "nearest-neighbour: greedy (default), or assignment, which uses the solver",
           kinds.OneOf(("greedy", "assignment")), {"tracker": ("nearest-neighbour",)}),
)  # fmt: skip
_OF_ALL = ("seed", "time_limit", "gate_probability")
TRACKING = (
    Option("tracker", "NAME", "name of the tracker, see below", kinds.OneOf(TRACKERS, _ALIASES)),
    Option("solver", "NAME", "name of the solver (default exact)"),
    Option("filter", "NAME", f"{', '.join(FILTERS)} (default: imm-cv, for recorded plots ekf)", kinds.OneOf(FILTERS)),
    Option("targets", "NAME",
           f"what is tracked, for the priors of speed and noise: {', '.join(TARGETS)}, or auto (of a scene)",
           kinds.OneOf((*TARGETS, "auto"))),
    Option("process_noise", "X", "process noise in m/s^1.5, for imm in m/s^2 (default 30, imm-cv by pace)",
           kinds.not_negative),
    Option("closed", "AREA", "no track starts here: 'X,Y X,Y' is a box, more corners a polygon, metres; again for "
           "each", kinds.area, rest={"action": "append"}),
    Option("no_adapt", "", "keep to the noise, detection probabilities and false alarms that are declared"),
    Option("extended", "", "targets may return several plots a scan, spread over their extent, as large ships do"),
    *(COMMON[name] for name in _OF_ALL),
    *_OF_TRACKERS,
)  # fmt: skip
"""Options of all trackers."""
_COMMON = (COMMON["import"], *verbosity("the settings that were used"))

IDENTITY = Option(
    "identity",
    "NAME",
    "codes and addresses: use, to associate plots; score-only, to judge the tracks by them (default); or ignore",
    kinds.OneOf(("use", "score-only", "ignore")),
    {"input": ("plots",)},
)
# parameters of the life cycle that are only for some rule
_LIFE_CYCLE = {
    "m": {"confirmation": ("m-of-n",)},
    "n": {"confirmation": ("m-of-n",)},
    "false_tracks_per_hour": {"confirmation": ("score",)},
    "false_probability": {"confirmation": ("score",)},
    "deletion_time": {"deletion": ("time",)},
    "deletion_count": {"deletion": ("count",)},
    "deletion_drop": {"deletion": ("score",)},
}
CUTOFF = 1_000.0
_SCENES = {"input": ("scenes",)}
_PLOTS = {"input": ("plots",)}
TRACKS = kinds.Output(".csv", ".parquet", strict=True, extras={".parquet": ("pyarrow", "parquet")})
TRACK = (
    Option("files", "FILE", "scene.npz, plots.csv (docs/recordings.md; several, as of the hours of a day), or "
           "radars.toml (docs/from_files.md)", positional=True, rest={"nargs": "+"}),
    Option("output", "FILE", "file for the tracks (.csv or .parquet)", TRACKS,
           short="-o", rest={"required": True}),
    Option("map", "FILE", "write the tracks for a map as well (.geojson or .kml); needs an origin",
           kinds.Output(".geojson", ".kml", ".json", strict=True, streams=False)),
    Option("asterix", "FILE", "write the tracks as ASTERIX category 062 as well (.ast; needs assoc[asterix])",
           kinds.Output(".ast", ".asterix", strict=True, streams=False, extras={"": ("asterix", "asterix")})),
    Option("origin", "LAT,LON[,H]", "where x = y = 0 is on the earth, degrees and metres (if not in FILE)",
           kinds.position_on_earth),
    Option("report", "FILE", "write an HTML page: tracks over time, metric, table (needs assoc[report])",
           kinds.html_page),
    Option("check", "", "print what is declared of sensors and targets against what was seen"),
    Option("all", "", "also write tracks that are tentative, or whose target may be gone"),
    Option("smooth", "", "write finished tracks instead: each position by all measurements of its track"),
)  # fmt: skip
OF_SCENES = (
    Option("cutoff", "M", f"GOSPA: farther than this from a target a track is false, metres (default {CUTOFF:g})",
           kinds.positive, _SCENES),
    Option("registration", "NAME", "first: estimate biases from all plots (with gains of range) and correct for them",
           kinds.OneOf(("first",)), {"input": ("scenes", "radars")}),
)  # fmt: skip
OF_PLOTS = (
    Option("window", "NAME",
           "how plots are grouped into scans: ctw, by antenna angle (default); ctw-time, by time; irregular, by "
           "random intervals; none, one by one", kinds.OneOf(("ctw", "ctw-time", "irregular", "none")), _PLOTS),
    replace(IDENTITY, only={"input": ("plots", "radars")}),
    Option("rates", "FILE", "write CT, MT and IT of each window (.csv; needs identities)", kinds.csv_table,
           {**_PLOTS, "identity": ("use", "score-only")}),
    Option("rotation", "S", "rotation period of the antenna, seconds (default: estimated)", kinds.seconds,
           {**_PLOTS, "window": ("ctw", "ctw-time")}),
    Option("radar", "SAC/SIC", "which radar of an ASTERIX file", only={**_PLOTS, "format": ("ASTERIX files",)}),
    Option("edition", "CAT=EDITION", "editions of categories, as 021=0.26,048=1.27 (default: those that fit)",
           kinds.editions_of, {**_PLOTS, "format": ("ASTERIX files",)}),
    Option("detection_probability", "P", "detection probability of the radar (default 0.8)", kinds.number, _PLOTS),
    Option("range_noise", "M", "standard deviation of range, metres (default: from the plots' steps)", kinds.number,
           _PLOTS),
    Option("bearing_noise", "DEG", "standard deviation of bearing, degrees (default: likewise)", kinds.degrees, _PLOTS),
    Option("false_alarms", "X", "mean number of false plots in a rotation (default 2.5)", kinds.number, _PLOTS),
)  # fmt: skip
# names of these options in `assoc.recordings.radar_of`
RADAR = {
    "detection_probability": "detection_probability",
    "false_alarms": "false_alarm_rate",
    "range_noise": "range_noise",
    "bearing_noise": "azimuth_noise",
}
LIVE = (
    Option("file", "FILE", "scene.npz with the sensors and the region, or radars.toml", positional=True),
    Option("output", "FILE", "file for the tracks (.csv; default: stdout)", kinds.Output(".csv", strict=True),
           short="-o"),
    Option("state", "FILE", "keep the state in this file (.npz) every few seconds; go on from it if it is there",
           kinds.Output(".npz", strict=True, streams=False)),
    Option("udp", "PORT", "read plots from this UDP port on 127.0.0.1 (default: stdin)", kinds.whole(0)),
    Option("replay", "X", "take the scene's own plots, X times as quickly as they were made (0: at once)",
           kinds.not_negative),
    Option("page", "PORT", "show the tracks moving on a page on 127.0.0.1 (0: any free port)", kinds.whole(0)),
    Option("registration", "NAME", "first: estimate biases from the plots of radars.toml, and take them off all others",
           kinds.OneOf(("first",))),
    Option("interval", "S", "seconds of plots taken in together (default 1 or a quarter turn)", kinds.number),
    Option("turns", "S,...", "seconds for a turn of each radar's antenna (default: all measure at the same time)",
           kinds.listed(kinds.number)),
    Option("horizon", "S", "seconds that plots may be late (default 30)", kinds.number),
    Option("wait", "S", "seconds for which an interval waits for plots (default 0)", kinds.number),
    IDENTITY,
)  # fmt: skip
_MORE = "\n".join(
    [
        "trackers:",
        *(f"  {name:<19}  {purpose}" for name, purpose in TRACKERS.items()),
        "",
        "further options (docs/tracking_reference.md):",
        "  track life cycle   --confirmation --false-tracks-per-hour --false-probability --missed-probability --m --n "
        "--deletion --deletion-time --deletion-count --deletion-drop --lifetime",
        "  track initiation   --speed --rest --birth-rate --widest",
        "  --identity use     --code-garbled --code-shared --address-garbled --address-shared",
        "  solver parameters  described by: python -m assoc.solve --solver NAME --help",
    ]
)
"""What ends the help."""


def track_parser() -> Parser:
    """Return the parser of ``assoc track``, without the options that `read_options` adds."""
    parser = Parser(
        prog="assoc.track",
        usage=f"{command('track')} FILE [--tracker NAME] [--solver NAME] [--filter NAME] -o tracks.csv [options]",
        description="Make tracks from the measurements of a scene (.npz) or from recorded radar plots.\n"
        f"{command('live')} makes tracks from plots as they come.",
        epilog=_MORE,
    )
    parser.declare(*TRACK, *_COMMON)
    parser.declare(*TRACKING, group="options of trackers")
    parser.declare(*OF_SCENES, group="options for scenes")
    parser.declare(*OF_PLOTS, group="options for plots")
    parser.elsewhere = lambda: {flag_of(option.name): "assoc live" for option in LIVE[1:]}
    return parser


def live_parser() -> Parser:
    """Return the parser of ``assoc live``, without the options that `read_options` adds."""
    called = command("live")
    parser = Parser(
        prog="assoc.live",
        usage=f"{called} FILE [--tracker NAME] [options] < plots > tracks.csv\n"
        f"       {called} FILE --udp PORT [--page PORT] [options]\n"
        f"       {called} FILE --replay X [--page PORT] [options]",
        description="Make tracks from radar plots as they come (lines of CSV or JSON), and write them as they change.",
        epilog=_MORE,
    )
    parser.declare(*LIVE, *_COMMON)
    parser.declare(*TRACKING, group="options of trackers")
    parser.elsewhere = lambda: {flag_of(option.name): "assoc track" for option in (*TRACK[1:], *OF_SCENES, *OF_PLOTS)}
    return parser


def read_options(words: list[str], parser: Parser) -> tuple[Given, dict[str, Any]]:
    """Read a command line; returns the options, and the arguments for the tracker.

    The parser has the program's options, without the further ones.
    """
    first = read_first(words, "solver", "import")
    import_modules(first["import"])
    solver = first["solver"] or "exact"
    if {"-h", "--help"} & {*words}:
        # for quick help: the packages that define the further options load slowly
        parser.parse_args(words)
    from assoc.tracking import IdentityParameters, Initiation, LifeCycle

    further = add_further(parser, solver)
    elsewhere = parser.elsewhere
    parser.elsewhere = lambda: {**flags_of_solvers(solver), **elsewhere()}
    given = parser.read(words)
    if _GNN in (word.rpartition("=")[2].lower() for word in words) and given["tracker"] == _ALIASES[_GNN]:
        # global nearest neighbours: all at once
        given["rule"] = given["rule"] or "assignment"
    values = {name: given.some(option.name for option in options) for name, options in further.items()}
    life_cycle = LifeCycle(**values["life_cycle"])
    given.check_use(further["life_cycle"], confirmation=life_cycle.confirmation, deletion=life_cycle.deletion)
    given.check_use(further["identity"], identity=given["identity"] or "score-only")
    settings: dict[str, Any] = {
        "solver": solver,
        "solver_parameters": values["solver"],
        "life_cycle": life_cycle,
        "initiation": Initiation(**values["initiation"], closed=tuple(given["closed"] or ())),
        **given.some(_OF_ALL),
    }
    if given["identity"] == "use":
        settings["identity"] = IdentityParameters(**values["identity"])
    return given, settings


def closing(initiation: Initiation, areas: Sequence[Array]) -> Initiation:
    """How tracks begin, with more areas where none starts."""
    more: Any = (*initiation.closed, *areas)
    return replace(initiation, closed=more) if areas else initiation


def add_further(parser: Parser, solver: str) -> dict[str, list[Option]]:
    """Add the parameters of the solver, the life cycle of tracks, their initiation, and identities."""
    from assoc.solvers import registry
    from assoc.tracking import IdentityParameters, Initiation, LifeCycle

    further = {
        "solver": parameter_options(registry.parameters(solver)),
        "life_cycle": [
            replace(option, only=_LIFE_CYCLE.get(option.name, {})) for option in parameter_options(LifeCycle)
        ],
        "initiation": [Option("speed", "X", "usual speed along an axis", kinds.number), *parameter_options(Initiation)],
        "identity": [replace(option, only={"identity": ("use",)}) for option in parameter_options(IdentityParameters)],
    }
    for options in further.values():
        parser.declare(*options)
    return further


def with_further(parser: Parser) -> Parser:
    """Return the parser with the options of `read_options` added."""
    add_further(parser, "exact")
    return parser


def make_tracker(
    name: str,
    sensors: Sequence[Sensor],
    parsed: Given,
    settings: dict[str, Any],
    region: Any,
    pace: float = 1.0,
    scene: Scene | None = None,
) -> Tracker:
    """Make the tracker that the options describe; `scene` is for ``--targets auto``.

    An option that does not apply to this tracker is refused.
    """
    from assoc.tracking import TRACKERS as KINDS
    from assoc.tracking.filter_choice import make_filter
    from assoc.tracking.target_kinds import target_kind

    parsed.check_use(_OF_TRACKERS, tracker=name)
    noise, falls = parsed["process_noise"], False
    if parsed["targets"] is not None:
        kind = target_kind(parsed["targets"], scene, KINDS[name].plain.for_scene)
        falls = kind.falls
        if noise is None:
            noise = kind.acceleration if parsed["filter"] in ("imm", "fuzzy") else kind.noise(pace)
        if parsed["speed"] is None:
            settings = settings | {"initiation": replace(settings["initiation"], speed=kind.speed)}
    made = make_filter(parsed["filter"], sensors, noise, settings.get("seed", 0), pace, region, falls)
    of_tracker = parsed.some(option.name for option in _OF_TRACKERS)
    adapt, extended = not parsed["no_adapt"], bool(parsed["extended"])
    if extended and not adapt:
        raise InvalidInputError("--extended: nothing is estimated with --no-adapt; leave one of them out")
    return KINDS[name](sensors, made, region=region, adapt=adapt, extended=extended, **settings, **of_tracker)
