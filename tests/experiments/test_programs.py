"""Every experiment is listed and explains itself."""

import runpy
import sys
import warnings

import pytest

from experiments.__main__ import main, programs

NAMES = [*programs()]


def test_the_list(capsys):
    assert main([]) == 0
    printed = capsys.readouterr().out
    assert {"benchmarks", "sdlib", "papers.ant_colony"} <= {*NAMES} and "__main__" not in NAMES
    assert all(f"\n{name}\n    {measures}\n" in printed and measures for name, measures in programs().items())


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
