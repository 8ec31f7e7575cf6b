"""Shell completion: scripts for names of programs, their options and the options' values."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import shtab

from assoc._cli.options import Parser
from assoc._cli.values import OneOf
from assoc.errors import InvalidInputError
from assoc.solvers import registry

SHELLS = ("bash", "zsh", "fish")
# completion of options whose values are file names
_FILES = ("FILE", "FOLDER", "SCENE.npz")

Parsers = Mapping[str, "argparse.ArgumentParser | Parsers"]
"""Parsers by the words that select them."""


def script(shell: str, programs: Parsers) -> str:
    """Return a script for a shell, one of `SHELLS`."""
    if shell not in SHELLS:
        raise InvalidInputError(f"completion: expected one of {', '.join(SHELLS)}, got {shell!r}")
    parser = argparse.ArgumentParser("assoc")
    _add(parser, programs)
    return shtab.complete(parser, shell)


def _add(parser: argparse.ArgumentParser, parsers: Parsers) -> None:
    subparsers = parser.add_subparsers()
    for name, entry in parsers.items():
        # shtab leaves out options without help
        if isinstance(entry, Mapping):
            _add(subparsers.add_parser(name, help=name), entry)
            continue
        declared = entry.declared if isinstance(entry, Parser) else {}
        for action in entry._actions:
            kind = declared[action.dest].kind if action.dest in declared else None
            if isinstance(kind, OneOf):
                action.choices = kind.names
            elif action.dest == "solver":
                action.choices = registry.names()
            elif action.metavar in _FILES:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
        subparsers.add_parser(name, help=name, parents=[entry], add_help=False)
