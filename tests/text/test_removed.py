"""Old spellings answer with one line that says what to use instead."""

import importlib
from collections.abc import Mapping

import pytest

import assoc
from assoc import solve, track
from assoc.__main__ import PROGRAMS
from assoc._text.removed import REMOVED, removed
from assoc.errors import InvalidInputError, RemovedError
from assoc.ranking.marginals import Marginals
from assoc.tracking import TRACKERS, LatePlots, Tracker
from assoc.tracking.adapting.health import Health

OWNERS = (Tracker, LatePlots, Health, Marginals)
"""Classes whose attributes went."""
OLD = {
    "--warp": "use --solver",
    "--tracker ants": "use mht",
    "assoc.solve_all": "use assoc.assign",
    "associate(warp)": "use solver",
    "aco(speed)": "use alpha",
    "Tracker.warp": "use step",
}


@pytest.fixture
def old(monkeypatch):
    for spelling, sentence in OLD.items():
        monkeypatch.setitem(REMOVED, spelling, sentence)


@pytest.mark.parametrize(
    "words", [["s.npz", "--warp", "3"], ["--warp=3"], ["s.npz", "-o", "t.csv", "--tracker", "ants"]]
)
def test_removed_options_and_values(old, capsys, words):
    try:
        code = track.main(words)
    except SystemExit as end:
        code = end.code
    out, err = capsys.readouterr()
    spelling = "--tracker ants" if "ants" in words else "--warp"
    assert code == 2 and out == "" and err.count("\n") == 1 and f"{spelling} exists no longer: {OLD[spelling]}" in err


def test_removed_keys_of_a_file(old, capsys, tmp_path):
    config = tmp_path / "options.toml"
    config.write_text("warp = 3")
    assert solve.main(["s.npz", "--config", str(config)]) == 2
    assert f"{config}: --warp exists no longer: use --solver" in capsys.readouterr().err


def test_removed_names_arguments_and_attributes(old):
    with pytest.raises(RemovedError, match="solve_all exists no longer: use assoc.assign"):
        assoc.solve_all  # noqa: B018
    with pytest.raises(ImportError, match="solve_all exists no longer: use assoc.assign"):
        from assoc import solve_all  # noqa: F401
    scene = assoc.simulation.simulate("three-radar", 0, scans=1)
    with pytest.raises(InvalidInputError, match=r"associate\(warp\) exists no longer: use solver"):
        assoc.associate(scene, "exact", warp=3)
    with pytest.raises(InvalidInputError, match=r"aco\(speed\) exists no longer: use alpha"):
        assoc.associate(scene, "aco", speed=3)
    tracker = TRACKERS["multi-sensor"].for_scene(scene)
    with pytest.raises(AttributeError, match=r"Tracker.warp exists no longer: use step"):
        tracker.warp  # noqa: B018
    with pytest.raises(AttributeError, match="no attribute 'weft'"):
        tracker.weft  # noqa: B018


def flags(parser):
    if isinstance(parser, Mapping):
        return set().union(*map(flags, parser.values()))
    return {*parser._option_string_actions}


@pytest.mark.parametrize("spelling", REMOVED)
def test_what_was_removed_is_not_there(spelling):
    line = removed(spelling)
    assert line.startswith(spelling) and "\n" not in line
    flag, _, value = spelling.partition(" ")
    if value.startswith("--"):
        assert value not in flags(importlib.import_module(flag).parser())
    elif spelling.startswith("--") and not value:
        parsers = {name: importlib.import_module(f"assoc.{name}").parser() for name in PROGRAMS}
        assert flag not in flags(parsers)
    elif spelling[0].isupper() and "(" not in spelling:
        owner, _, name = spelling.partition(".")
        (kind,) = [kind for kind in OWNERS if kind.__name__ == owner]
        with pytest.raises(AttributeError, match="exists no longer"):
            getattr(kind.__new__(kind), name)
    elif spelling.startswith("assoc."):
        package, _, name = spelling.rpartition(".")
        with pytest.raises(RemovedError):
            getattr(importlib.import_module(package), name)
