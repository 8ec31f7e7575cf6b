"""Problems in text form that are none: one line that names the file, and no warning of numpy's beside it."""

import pytest

from assoc import AssignmentProblem
from assoc.errors import InvalidInputError

HEAD = "assoc-problem 1\nsizes 2 2\ndummies yes\ntuples 1\n"


@pytest.mark.parametrize("index", ["nan", "inf", "-inf", "1e300", "1.5", "9223372036854775808"])
def test_indices_that_are_none(tmp_path, index):
    (tmp_path / "p.txt").write_text(f"{HEAD}-1.0 1 {index}\n")
    with pytest.raises(InvalidInputError, match="p.txt: tuples: indices must be whole numbers"):
        AssignmentProblem.load(tmp_path / "p.txt")


def test_a_line_that_is_quoted_is_one(tmp_path):
    (tmp_path / "p.txt").write_text(HEAD.replace("yes", "y\x0be\x85s"))
    with pytest.raises(InvalidInputError, match="expected 'dummies yes' or 'dummies no'") as caught:
        AssignmentProblem.load(tmp_path / "p.txt")
    assert len(str(caught.value).splitlines()) == 1


def test_names_that_no_file_has():
    with pytest.raises(InvalidInputError, match="cannot be read") as caught:
        AssignmentProblem.load("p\0.txt")
    assert "\n" not in str(caught.value)
