"""Every experiment is listed, explains itself, and names files that exist."""

from __future__ import annotations

import re
import runpy
import sys
import warnings
from pathlib import Path

import pytest

from experiments.__main__ import EXPERIMENTS, main

ROOT = Path(__file__).parents[2]
NAMES = [one.name for one in EXPERIMENTS]


def test_all_programs_are_listed():
    folder = ROOT / "experiments"
    found = set()
    for path in folder.rglob("*.py"):
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8"):
            parts = path.relative_to(folder).with_suffix("").parts
            found.add(".".join(part for part in parts if part != "__main__"))
    assert found - {""} == set(NAMES)
    assert len(NAMES) == len(set(NAMES))


def test_the_list(capsys):
    assert main([]) == 0
    printed = capsys.readouterr().out
    for one in EXPERIMENTS:
        assert one.name in printed
        assert one.regenerates in printed
        for path in re.findall(r"[\w./-]+/[\w./-]+", one.regenerates):
            assert (ROOT / path).exists(), f"{one.name}: {path}"


@pytest.mark.parametrize("name", NAMES)
def test_help(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["program", "--help"])
    with warnings.catch_warnings(), pytest.raises(SystemExit) as stop:
        # the module may have been imported by another test
        warnings.simplefilter("ignore", RuntimeWarning)
        runpy.run_module(f"experiments.{name}", run_name="__main__")
    assert stop.value.code == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"usage: python -m experiments.{name}")


@pytest.mark.parametrize("words", [["x", "1"], ["10"], ["0", "1"]])
def test_scale_refuses_what_it_does_not_understand(words, capsys):
    from experiments.benchmarks import scale

    with pytest.raises(SystemExit) as stop:
        scale.program(words)
    assert stop.value.code == 2
    assert "experiments.benchmarks.scale: error" in capsys.readouterr().err
