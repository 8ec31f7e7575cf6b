"""``python -m assoc.simulate``: simulate a scene or a recording of plots and write it to a file.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import takewhile
from typing import Any

from assoc._cli.inputs import check_ending, check_outputs
from assoc._cli.lines import print_lines
from assoc._cli.options import add_common_options, common_values, parameter_values
from assoc._cli.program import Parser, command, prepare_process, run_program
from assoc._cli.speech import SPEECH_FLAGS, add_speech_options, spoken
from assoc._parameters import Option, options
from assoc._text.near import did_you_mean
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

_PURPOSE = {
    "three-radar": "three targets, three radars, 100 scans (as in the ant colony paper)",
    "crowd": "many targets at random positions in a box",
    "bearing-only": "bearing sensors only, with many ghosts (false intersections of bearings)",
    "dubins-uav": "unmanned aircraft on Dubins paths around no-fly zones",
    "rotating-radars": "airliners under three radars that turn at their own paces; each plot has its own time",
    "from-tracks": "recorded trajectories (CSV), measured by simulated radars",
    "rotating-radar": "plots (CSV) of one rotating radar: random traffic, or two close aircraft",
}

_PLOTS = ("rotating-radar",)
"""Scenarios that write plots, not a scene."""


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as a process of its own."""
    prepare_process("assoc.simulate")
    return main(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _simulate(words), "assoc.simulate")


def _simulate(words: list[str]) -> None:
    before = [*takewhile(lambda word: word in SPEECH_FLAGS, words)]
    words = [*words[len(before) : len(before) + 1], *before, *words[len(before) + 1 :]]
    scenario = words[0] if words else ""
    if scenario not in _PURPOSE:
        near = did_you_mean(scenario, _PURPOSE)
        if near and not scenario.startswith("-"):
            raise InvalidInputError(f"unknown scenario {scenario!r}; {near}")
        # neither a scenario nor --help: let the parser of scenarios say so
        _list_parser().parse_args(words[:1])
        return
    from assoc import simulation

    choices = options(simulation.parameters(scenario))
    parsed = vars(_parser(scenario, choices).parse_args(words[1:]))
    seed = common_values(parsed).get("seed", 0)
    values = parameter_values(choices, parsed)
    inputs = [value for value in values.values() if isinstance(value, str)]
    check_outputs([parsed["output"], parsed.get("truth")], inputs)
    check_ending(parsed["output"], "--output", ".csv" if scenario in _PLOTS else ".npz")
    check_ending(parsed.get("truth"), "--truth", ".csv")
    with spoken(quiet=parsed["quiet"], outputs=[parsed["output"], parsed.get("truth")]):
        if parsed["verbose"]:
            used = {"seed": seed} | {option.name: values.get(option.name, option.default) for option in choices}
            print_lines(f"{scenario}: " + ", ".join(f"{name} {value}" for name, value in used.items()))
        if scenario in _PLOTS:
            _write_plots(scenario, seed, parsed, values)
            return
        scene = simulation.simulate(scenario, seed, **values)
        scene.save(parsed["output"])
        print_lines(f"{printable(parsed['output'])}: {scene!r}")
        for what, count in scene.notes.items():
            print_lines(f"{what}: {count:,}")


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    from assoc import simulation

    flags: dict[str, Sequence[str]] = {"": tuple(_PURPOSE)}
    for scenario in _PURPOSE:
        flags |= _parser(scenario, options(simulation.parameters(scenario))).flags()
    return flags


def _write_plots(scenario: str, seed: int, parsed: dict[str, Any], values: dict[str, Any]) -> None:
    from assoc import simulation
    from assoc.recordings import write_plots, write_tracks

    output, truth = parsed["output"], parsed["truth"]
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


def _parser(scenario: str, choices: list[Option]) -> Parser:
    parser = Parser(prog=f"assoc.simulate {scenario}", description=_PURPOSE[scenario] + ".")
    content = "file for the plots (.csv)" if scenario in _PLOTS else "file for the scene (.npz)"
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help=content)
    if scenario in _PLOTS:
        text = "also write the aircraft's true positions each time the antenna points at them (.csv)"
        parser.add_argument("--truth", metavar="FILE", help=text)
    add_common_options(parser, ["seed"])
    add_speech_options(parser, "all parameters, the defaults included")
    group = parser.add_argument_group("scenario")
    for option in choices:
        option.add_to(parser if option.positional else group)
    return parser


if __name__ == "__main__":
    raise SystemExit(start())
