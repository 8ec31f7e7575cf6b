"""Each fault of `make mutants` still fits its file, and its tests exist."""

import ast
from pathlib import Path

import pytest

from tests.mutations.faults import FAULTS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.what)
def test_its_text_occurs_once(fault):
    text = (ROOT / fault.file).read_text(encoding="utf-8")
    changed = fault.put_in(text)
    assert changed != text
    # a fault that is no Python would be noticed by any test
    ast.parse(changed)
    assert (ROOT / fault.test).is_file()


def test_faults_differ():
    assert len({fault.what for fault in FAULTS}) == len({(fault.file, fault.old, fault.new) for fault in FAULTS})
    assert len(FAULTS) >= 30
