"""``python -m assoc.simulate``: simulate a scene or a recording of plots and write it to a file.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

from itertools import takewhile
from typing import Any

from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import COMMON, VERBOSITY_FLAGS, Given, Option, Parser, parameter_options, verbosity
from assoc._cli.program import Program, command
from assoc._cli.signals import EarlyEnd
from assoc._cli.values import Output
from assoc._parameters import parameters_of
from assoc._text.near import did_you_mean
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

_PURPOSE = {
    "three-radar": "three targets, three radars, 100 scans (as in the ant colony paper)",
    "crowd": "many targets at random positions in a box",
    "bearing-only": "bearing sensors only, with many ghosts (false intersections of bearings)",
    "dubins-uav": "unmanned aircraft on Dubins paths around no-fly zones",
    "rotating-radars": "airliners under three radars that turn at their own paces; each plot has its own time",
    "arrival-times": "waves that stations hear at times of which the emission is not known",
    "from-tracks": "recorded trajectories (CSV), measured by simulated radars",
    "rotating-radar": "plots (CSV) of one rotating radar: random traffic, or two close aircraft",
}

_PLOTS = ("rotating-radar",)
"""Scenarios that write plots instead of a scene."""

_TRUTH = Option(
    "truth",
    "FILE",
    "also write the aircraft's true positions each time the antenna points at them (.csv)",
    Output(".csv", strict=True),
)


def _simulate(words: list[str]) -> None:
    before = [*takewhile(lambda word: word in VERBOSITY_FLAGS, words)]
    words = [*words[len(before) : len(before) + 1], *before, *words[len(before) + 1 :]]
    scenario = words[0] if words else ""
    if scenario not in _PURPOSE:
        near = did_you_mean(scenario, _PURPOSE)
        if near and not scenario.startswith("-"):
            raise InvalidInputError(f"unknown scenario {scenario!r}; {near}")
        # neither a scenario nor --help: the parser of scenarios reports it
        _list_parser().parse_args(words[:1])
        return
    from assoc import simulation

    given = _parser(scenario).read(words[1:])
    seed = given["seed"] or 0
    parameters = parameters_of(simulation.parameters(scenario))
    values = given.some(parameter.name for parameter in parameters)
    given.check_outputs([], reserved=[value for value in values.values() if isinstance(value, str)])
    with messages(given):
        if given["verbose"]:
            used = {"seed": seed} | {
                parameter.name: values.get(parameter.name, parameter.default) for parameter in parameters
            }
            print_lines(f"{scenario}: " + ", ".join(f"{name} {value}" for name, value in used.items()))
        if scenario in _PLOTS:
            _write_plots(scenario, seed, given, values)
            return
        scene = simulation.simulate(scenario, seed, **values)
        scene.save(given["output"])
        print_lines(f"{printable(given['output'])}: {scene!r}")
        for what, count in scene.notes.items():
            print_lines(f"{what}: {count:,}")


def parser() -> dict[str, Parser]:
    """Return the parsers of the scenarios."""
    return {scenario: _parser(scenario) for scenario in _PURPOSE}


def _write_plots(scenario: str, seed: int, given: Given, values: dict[str, Any]) -> None:
    from assoc import simulation
    from assoc.recordings import write_plots, write_tracks

    output, truth = given["output"], given["truth"]
    simulated = simulation.simulate_recording(scenario, seed, **values)
    write_plots(output, simulated.recording)
    if truth is not None:
        rows = simulated.truth
        write_tracks(truth, rows.ids, rows.times, rows.positions, simulated.velocities)
    print_lines(f"{printable(output)}: {simulated.recording!r}")
    if truth is not None:
        print_lines(f"{printable(truth)}: {simulated.truth!r}")


def _list_parser() -> Parser:
    lines = [f"  {name:<15} {purpose}" for name, purpose in _PURPOSE.items()]
    parser = Parser(
        prog="assoc.simulate",
        usage=f"{command('simulate')} SCENARIO -o scene.npz [options]",
        description="Simulate a scene (or plots) and write it to a file.",
        epilog="scenarios (each has its own --help):\n" + "\n".join(lines),
    )
    parser.add_argument("scenario", metavar="SCENARIO", choices=list(_PURPOSE), help="what to simulate")
    return parser


def _parser(scenario: str) -> Parser:
    from assoc import simulation

    plots = scenario in _PLOTS
    content = "file for the plots (.csv)" if plots else "file for the scene (.npz)"
    parser = Parser(prog=f"assoc.simulate {scenario}", description=_PURPOSE[scenario] + ".")
    parser.declare(
        Option("output", "FILE", content, Output(".csv" if plots else ".npz", strict=True),
               short="-o", rest={"required": True})
    )  # fmt: skip
    if plots:
        parser.declare(_TRUTH)
    parser.declare(COMMON["seed"], *verbosity("all parameters, the defaults included"))
    options = parameter_options(simulation.parameters(scenario))
    parser.declare(*(option for option in options if option.positional))
    parser.declare(*(option for option in options if not option.positional), group="scenario")
    return parser


PROGRAM = Program("assoc.simulate", _simulate, EarlyEnd("assoc.simulate").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())
