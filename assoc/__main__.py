"""``assoc`` and ``python -m assoc``: the programs as subcommands. Imports inside functions keep --help quick."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

from assoc._cli.lines import print_lines
from assoc._cli.options import BAD_INPUT, VERBOSITY_FLAGS
from assoc._cli.program import command, prepare_streams, run_program
from assoc._text.near import did_you_mean
from assoc._text.plain import one_line
from assoc._version import __version__

PROGRAMS = {
    "simulate": ("simulate a scene", "three-radar -o scene.npz"),
    "solve": ("associate its measurements", "scene.npz --solver aco"),
    "inspect": ("say what it understands of several radars' files", "radars.toml --picture plots.png"),
    "track": ("make tracks of scenes or of recorded radar plots", "scene.npz -o tracks.csv"),
    "live": ("make tracks of radar plots as they come", "scene.npz --page 0 < plots > tracks.csv"),
    "locate": ("find emissions from arrival times at stations", "picks.csv --stations stations.csv ... -o events.csv"),
    "register": ("find biases of sensors", "scene.npz -o registered.npz"),
    "asterix2csv": ("write the records of an ASTERIX file as CSV", "radars.pcap -o records.csv"),
    "sweep": ("compare parameters", "scene.npz --solver aco --grid alpha=1,2,3 -o study/"),
}
"""For each program, a module ``assoc.NAME`` with a function ``start``: what it does, and an example."""

_OTHERS = {
    "check": ("check a proof, or a solution, in exact arithmetic", "problem.txt proof.json"),
    "warm-up": ("compile all kernels, once after installation", ""),
    "completion": ("print what a shell needs to complete names and options", "bash (or zsh, fish)"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a program by its name; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    forwarded = []
    while words and words[0] in VERBOSITY_FLAGS:
        forwarded.append(words.pop(0))
    name, *rest = words or ["--help"]
    if name == "check":
        # check.py stands alone: it shares nothing with the other programs
        prepare_streams()
        return import_module("assoc.check").main(rest)
    if name in PROGRAMS:
        start = import_module(f"assoc.{name}").start
        return start([*forwarded, *rest])
    prepare_streams()
    if name == "completion":
        return run_program(lambda: _complete(rest), "assoc")
    if name == "warm-up":
        return run_program(lambda: _warm_up(rest), "assoc")
    if name in ("-h", "--help", "help"):
        return run_program(_list, "assoc")
    if name in ("-V", "--version"):
        return run_program(lambda: print(f"assoc {__version__}"), "assoc")
    hint = did_you_mean(name, [*PROGRAMS, *_OTHERS, "--help", "--version"])
    known = ", ".join([*PROGRAMS, *_OTHERS, "--version"])
    print(f"assoc: error: unknown command {one_line(name)!r}; {hint or 'known: ' + known}", file=sys.stderr)
    return BAD_INPUT


def _list() -> None:
    print_lines("assoc: which measurements, from several sensors, came from the same target?")
    print_lines("\nPrograms (each has --help, -q to say nothing and -v to say more):")
    for name, (purpose, example) in {**PROGRAMS, **_OTHERS}.items():
        called = command(name) if name in PROGRAMS or name == "check" else f"assoc {name}"
        print_lines(f"  {name:<11}  {purpose}: {called} {example}".rstrip())
    print_lines("\nassoc --version prints the version.")


def _warm_up(words: Sequence[str]) -> None:
    from argparse import ArgumentParser

    from assoc.tracking.warm_up import warm_up

    about = "Compile all kernels, or load them; takes minutes once after installation, then seconds."
    ArgumentParser("assoc warm-up", description=about).parse_args(words)
    print(f"all kernels are compiled, in {warm_up():.0f} s")


def _complete(words: Sequence[str]) -> None:
    from argparse import ArgumentParser

    from assoc._cli.completion import SHELLS, script

    check, shells = ArgumentParser(add_help=False), ArgumentParser(add_help=False)
    check.add_argument("files", nargs="*", metavar="FILE")
    shells.add_argument("shell", choices=SHELLS)
    others = {"check": check, "completion": shells, "warm-up": ArgumentParser()}
    programs = {name: import_module(f"assoc.{name}").parser() for name in PROGRAMS}
    print(script(words[0] if words else "", {**programs, **others}))


if __name__ == "__main__":
    raise SystemExit(main())
