"""``python -m assoc.register``: biases of a scene's sensors, and the scene without them.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import check_ending, check_outputs
from assoc._cli.lines import print_lines
from assoc._cli.options import add_common_options, common_values
from assoc._cli.program import Parser, command, prepare_process, run_program, write_all
from assoc._cli.speech import add_speech_options, spoken
from assoc._cli.table import print_table
from assoc._cli.values import number
from assoc._files.output import STDOUT, is_stream
from assoc._system.extras import check_extra
from assoc._text.plain import printable
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.registration import Registration

# option -> field of the parameters, and its unit
_SPREADS = {
    "range_spread": 1.0,
    "angle_spread": math.pi / 180.0,
    "time_spread": 1.0,
    "position_spread": 1.0,
}


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as a process of its own."""
    prepare_process("assoc.register")
    return main(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _register(words), "assoc.register")


def _register(words: list[str]) -> None:
    parsed = vars(_parser().parse_args(words))
    file, output, page = parsed["file"], parsed["output"], parsed["report"]
    if page == "":
        if output == STDOUT or is_stream(output):
            raise InvalidInputError(f"--report: expected a name, for there is none in --output {output}")
        page = f"{output.removesuffix('.npz')}.html"
    check_outputs([output, page, parsed["json"]], [file])
    check_ending(output, "--output", ".npz")
    check_ending(page, "--report", ".html", ".htm", strict=False)
    check_ending(parsed["json"], "--json", ".json", strict=False)
    if page:
        check_extra("plotly", "report")
    values: dict[str, Any] = common_values(parsed)
    for name, unit in _SPREADS.items():
        if parsed[name] is not None:
            values[name] = unit * number(parsed[name], f"--{name.replace('_', '-')}")
    for name in ("components", "reference"):
        if parsed[name] is not None:
            values[name] = tuple(one.strip() for one in parsed[name].split(","))
    with spoken(quiet=parsed["quiet"], outputs=[output, page, parsed["json"]]):
        _write(words, parsed, page, values)


def _write(words: list[str], parsed: dict[str, Any], page: str | None, values: dict[str, Any]) -> None:
    file, output = parsed["file"], parsed["output"]
    from assoc.registration import register
    from assoc.scene.scene import Scene

    scene = Scene.load(file)
    if parsed["verbose"]:
        used = ", ".join(f"{name} {value}" for name, value in values.items())
        print_lines(f"{printable(file)}: {scene!r}; {used or 'all defaults'}")
    started = time.perf_counter()
    found = register(scene, **values)
    elapsed = time.perf_counter() - started

    def write_report() -> None:
        if page:
            from assoc.plotting.report import write_registration_report

            write_registration_report(page, found, name=scene.name or file, words=words)

    write_all(
        lambda: found.correct(scene).save(output),
        lambda: found.to_json(parsed["json"]) if parsed["json"] else None,
        write_report,
        lambda: _print(found, output, elapsed),
    )


def _parser() -> Parser:
    parser = Parser(
        prog="assoc.register",
        usage=f"{command('register')} SCENE.npz -o REGISTERED.npz [options]",
        description="Estimate biases of sensors from the targets that they have in common, without knowing the truth,\n"
        "and write the scene without them.",
    )
    add = parser.add_argument
    add("file", metavar="SCENE.npz", help="scene whose sensors are registered")
    add("-o", "--output", required=True, metavar="FILE", help="file for the scene without the biases (.npz)")
    add("--json", metavar="FILE", help="write the biases, their covariance and what is not observable as JSON")
    add(
        "--report", metavar="FILE", nargs="?", const="",
        help="write an HTML page: biases, residuals before and after (default name: the output's, .html; needs "
        "assoc[report])",
    )  # fmt: skip
    add(
        "--components", metavar="NAMES",
        help="biases to estimate: range,azimuth,elevation,time,position (default range,azimuth,elevation)",
    )  # fmt: skip
    add("--reference", metavar="NAMES", help="sensors taken for free of bias, by name or number from 1, with commas")
    add("--range-spread", metavar="M", help="usual size of range biases, metres (default 300)")
    add("--angle-spread", metavar="DEG", help="usual size of azimuth and elevation biases, degrees (default 0.3)")
    add("--time-spread", metavar="S", help="usual size of clocks' biases, seconds (default 1)")
    add("--position-spread", metavar="M", help="usual error of sensors' places, metres (default 300)")
    add_common_options(parser, ["seed", "max_tuples"])
    add_speech_options(parser, "the options that were used")
    return parser


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    return {**_parser().flags()}


def _print(found: Registration, output: str, elapsed: float) -> None:
    rows = [
        [row["sensor"], row["component"], f"{row['bias']:.4g}", f"{row['sigma']:.2g}", row["unit"]]
        + ["yes" if row["observed"] else "no"]
        for row in found.rows()
    ]
    headers = ["sensor", "component", "bias", "sigma", "unit", "observed"]
    print_table(
        [*headers], [[printable(cell) for cell in row] for row in rows], keys=2, left=("sensor", "component", "unit")
    )
    print()
    print_lines(found.summary())
    print_lines(f"{printable(output)}: written; {elapsed:.2f} s")


if __name__ == "__main__":
    raise SystemExit(start())
