"""``python -m assoc.register``: estimates biases of a scene's sensors, and writes the scene without them.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from assoc._cli.biases import print_biases
from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import COMMON, Given, Option, Parser, verbosity
from assoc._cli.program import Program, command, write_all
from assoc._cli.signals import EarlyEnd
from assoc._cli.values import Output, degrees, html_page, listed, number, text
from assoc._files.output import STDOUT, is_stream
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.registration import Registration

_SETTINGS = (
    Option("components", "NAMES",
           "biases to estimate: range,azimuth,elevation,gain,time,position (default range,azimuth,elevation)",
           listed(text)),
    Option("reference", "NAMES", "sensors taken for free of bias, by name or number from 1, with commas",
           listed(text)),
    Option("range_spread", "M", "usual size of range biases, metres (default 300)", number),
    Option("angle_spread", "DEG", "usual size of azimuth and elevation biases, degrees (default 0.3)", degrees),
    Option("gain_spread", "M", "usual gain of ranges, metres per metre (default 0.001: 1 m in each km)", number),
    Option("time_spread", "S", "usual size of clocks' biases, seconds (default 1)", number),
    Option("position_spread", "M", "usual error of sensors' positions, metres (default 300)", number),
    COMMON["seed"],
    COMMON["max_tuples"],
)  # fmt: skip
_OPTIONS = (
    Option("file", "SCENE.npz", "scene whose sensors are registered", positional=True),
    Option("output", "FILE", "file for the scene without the biases (.npz)", Output(".npz", strict=True),
           short="-o", rest={"required": True}),
    Option("json", "FILE", "write the biases, their covariance and what is not observable as JSON", Output(".json")),
    Option("report", "FILE",
           "write an HTML page: biases, residuals before and after (default name: the output's, .html; needs "
           "assoc[report])", html_page, rest={"nargs": "?", "const": ""}),
    *_SETTINGS,
    *verbosity("the options that were used"),
)  # fmt: skip


def _register(words: list[str]) -> None:
    given = parser().read(words)
    output = given["output"]
    if given["report"] == "":
        if output == STDOUT or is_stream(output):
            raise InvalidInputError(f"--report: expected a file name, because --output {output} has none")
        given["report"] = f"{output.removesuffix('.npz')}.html"
    given.check_outputs([given["file"]])
    with messages(given):
        _write(given, given.some(parameter.name for parameter in _SETTINGS))


def _write(given: Given, values: dict[str, Any]) -> None:
    file, output = given["file"], given["output"]
    from assoc.registration import register
    from assoc.scene.scene import Scene

    scene = Scene.load(file)
    if given["verbose"]:
        used = ", ".join(f"{name} {value}" for name, value in values.items())
        print_lines(f"{printable(file)}: {scene!r}; {used or 'all defaults'}")
    started = time.perf_counter()
    found = register(scene, **values)
    elapsed = time.perf_counter() - started

    def write_report() -> None:
        from assoc.plotting.report import write_registration_report

        write_registration_report(given["report"], found, name=scene.name or file, words=given.words)

    write_all(
        (output, lambda: found.correct(scene).save(output)),
        (given["json"], lambda: found.to_json(given["json"])),
        (given["report"], write_report),
        (given, lambda: _print(found, output, elapsed)),
    )


def parser() -> Parser:
    """Return the parser of the program."""
    made = Parser(
        prog="assoc.register",
        usage=f"{command('register')} SCENE.npz -o REGISTERED.npz [options]",
        description="Estimate biases of sensors from the targets that they have in common, \n"
        "without knowing the truth, and write the scene without them.",
    )
    made.declare(*_OPTIONS)
    return made


def _print(found: Registration, output: str, elapsed: float) -> None:
    print_biases(found)
    print_lines(f"{printable(output)}: written; {elapsed:.2f} s")


PROGRAM = Program("assoc.register", _register, EarlyEnd("assoc.register").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())
