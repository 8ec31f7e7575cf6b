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
    from assoc._cli.track.radars_file import Radars
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
    Option("file", "FILE", "scene.npz, or radars.toml (docs/from_files.md)", positional=True),
    Option("output", "FILE", "file for the scene without the biases (.npz)", Output(".npz", strict=True), short="-o"),
    Option("write", "", "write the biases into radars.toml, where assoc track and assoc live take them off"),
    Option("json", "FILE", "write the biases, their covariance and what is not observable as JSON", Output(".json")),
    Option("report", "FILE",
           "write an HTML page: biases, residuals before and after (default name: the output's or the input's, .html; "
           "needs assoc[report])", html_page, rest={"nargs": "?", "const": ""}),
    *_SETTINGS,
    *verbosity("the options that were used"),
)  # fmt: skip


def _register(words: list[str]) -> None:
    given = parser().read(words)
    output, described = given["output"], given["file"].lower().endswith(".toml")
    if not described:
        from assoc.association.source import refuse_text

        refuse_text(given["file"])
    if output is None and not described:
        raise InvalidInputError("-o: expected a file for the scene without the biases")
    if given["write"] and not described:
        raise InvalidInputError("--write: expected radars.toml, in which a radar has a bias; a scene has none")
    if given["write"] and "position" in (given["components"] or ()):
        raise InvalidInputError("--write: a bias of the position is not written; correct place in the file by hand")
    if given["report"] == "":
        if output == STDOUT or (output and is_stream(output)):
            raise InvalidInputError(f"--report: expected a file name, because --output {output} has none")
        given["report"] = f"{(output or given['file']).removesuffix('.npz').removesuffix('.toml')}.html"
    given.check_outputs([given["file"]])
    with messages(given):
        _write(given, given.some(parameter.name for parameter in _SETTINGS))


def _write(given: Given, values: dict[str, Any]) -> None:
    file, output = given["file"], given["output"]
    from assoc._cli.track.radars_file import read_radars
    from assoc.registration import register
    from assoc.scene.scene import Scene

    radars = read_radars(file) if file.lower().endswith(".toml") else None
    scene = Scene.load(file) if radars is None else radars.scene
    if given["verbose"]:
        used = ", ".join(f"{name} {value}" for name, value in values.items())
        print_lines(f"{printable(file)}: {scene!r}; {used or 'all defaults'}")
    if radars is not None and "reference" not in values:
        values["reference"] = radars.references
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
        (given, lambda: print_biases(found)),
        (given["write"] or None, lambda: _write_biases(file, radars, found)),
        (given, lambda: print_lines(f"{printable(output) + ': written; ' if output else ''}{elapsed:.2f} s")),
    )


def _write_biases(file: str, radars: Radars | None, found: Registration) -> None:
    """Add what was found to what the description says already."""
    from assoc._cli.track.radars_file import write_biases

    assert radars is not None
    if not found.significant:
        print_lines(f"{printable(file)}: stays as it is")
        return
    write_biases(file, radars.with_further(found))
    print_lines(f"{printable(file)}: biases written")


def parser() -> Parser:
    """Return the parser of the program."""
    made = Parser(
        prog="assoc.register",
        usage=f"{command('register')} SCENE.npz -o REGISTERED.npz [options]\n"
        f"       {command('register')} radars.toml [--write] [options]",
        description="Estimate biases of sensors from the targets that they have in common, \n"
        "without knowing the truth, and write the scene without them, or the biases into radars.toml.",
    )
    made.declare(*_OPTIONS)
    return made


PROGRAM = Program("assoc.register", _register, EarlyEnd("assoc.register").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())
