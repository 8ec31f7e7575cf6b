"""Designs: grids, TOML tables, and what is refused."""

import pickle

import pytest

from assoc.errors import InvalidInputError, LimitExceededError
from assoc.sweeps import Setting, grid
from assoc.sweeps.design import combinations, read_words, settings_of


def test_a_grid_is_every_combination_and_the_last_varies_fastest():
    found = grid("aco", {"alpha": [1, 2], "rho": [0.3, 0.5, 0.3]})
    assert [(s.parameters["alpha"], s.parameters["rho"]) for s in found] == [(1, 0.3), (1, 0.5), (2, 0.3), (2, 0.5)]
    assert all(s.parameters["ants"] == 15 for s in found)
    assert grid("greedy") == [Setting("greedy", {})]


def test_equal_settings_have_equal_keys_whatever_was_left_out():
    assert Setting("aco", {}) == Setting("aco", {"alpha": 2}) == Setting("aco", {"rho": 0.3, "alpha": 2.0})
    assert Setting("aco", {"alpha": 3}) != Setting("aco", {"beta": 3})
    copy = pickle.loads(pickle.dumps(Setting("aco", {"alpha": 3})))
    assert copy == Setting("aco", {"alpha": 3}) and copy.parameters == Setting("aco", {"alpha": 3}).parameters


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: grid("acoo"), "did you mean aco"),
        (lambda: grid("aco", {"alhpa": [1]}), "did you mean alpha"),
        (lambda: grid("aco", {"alpha": []}), "empty"),
        (lambda: grid("aco", {"alpha": ["much"]}), "expected a number"),
        (lambda: combinations("aco", read_words(["alpha=1:2"], ["aco"])["aco"], "--grid"), "which only --tune takes"),
        (lambda: read_words(["alpha=2:1"], ["aco"]), "low < high"),
        (lambda: read_words(["alpha=0:1:log"], ["aco"]), "low > 0"),
        (lambda: read_words(["alpha"], ["aco"]), "expected NAME=VALUE"),
        (lambda: read_words(["alpha=1,,2"], ["aco"]), "expected a number, got ''"),
        (lambda: read_words(["alpha=1", "alpha=2"], ["aco"]), "twice"),
        (lambda: read_words(["milp.backend=scip"], ["aco"]), "no solver of the study"),
        (
            lambda: settings_of({"aco": {"alpha": {"low": 1}}}, "study.toml: "),
            "^study.toml: aco.alpha: expected",
        ),
    ],
)
def test_bad_designs_are_one_clear_line(make, message):
    with pytest.raises(InvalidInputError, match=message) as raised:
        make()
    assert "\n" not in str(raised.value)


def test_a_design_without_end_is_refused_before_it_is_made():
    with pytest.raises(LimitExceededError, match="settings"):
        grid("aco", {name: list(range(1, 2000)) for name in ("ants", "iterations", "patience")})
