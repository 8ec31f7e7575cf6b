"""A fixed sample of spoiled files for every reader; `make fuzz` runs tens of thousands."""

import io
import zipfile

import numpy as np
import pytest

from assoc.errors import InvalidInputError, LimitExceededError
from assoc.problem import AssignmentProblem
from tests.reliability.fuzzing import judge, prepare, run_case, warm_up
from tests.reliability.readers import ROOMS, Room
from tests.running import printed
from tests.sizes import few_or_all


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    files = prepare(tmp_path_factory.mktemp("valid"))
    # the first use compiles, which is not the reader's time
    warm_up(files)
    return files


@few_or_all("count", 60, 500)
def test_hundreds_of_spoiled_files(count, made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    faults = [run_case(77, number, made, tmp_path) for number in range(count)]
    assert [fault for fault in faults if fault] == []


def test_a_problem_of_a_billion_measurements_is_refused():
    """Its singletons alone would take a hundred gigabytes; the file that says so has a kilobyte."""
    with pytest.raises(LimitExceededError, match="memory"):
        AssignmentProblem(np.zeros((0, 2), np.int32), [], [2**30, 2**30 - 5])


def test_the_judge_sees_faults(tmp_path):
    """Readers made wrong on purpose."""

    def lines(path):
        raise InvalidInputError("one\ntwo")

    def crash(path):
        return [][1]

    path = tmp_path / "x"
    for read, words in [(lines, "several lines"), (crash, "IndexError"), (lambda path: None, None)]:
        fault = judge(Room("x", "text", lambda folder: [], read), path)
        assert (fault is None) if words is None else words in fault


def test_a_format_that_claims_gigabytes_is_refused_before_they_are_taken(tmp_path):
    """The first look at a file, which asks only for its format, takes no more on trust than the reader does."""
    path = tmp_path / "large.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<U500000000", "fortran_order": False, "shape": ()})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("format.npy", header.getvalue())
    code = (
        "import sys, tracemalloc; import numpy; from assoc._files.npz import format_of; tracemalloc.start();"
        "assert format_of(sys.argv[1]) is None; assert tracemalloc.get_traced_memory()[1] < 1e6"
    )
    printed("-W", "error", "-c", code, path)


@pytest.mark.parametrize("column", [1, 2, 4])
def test_numbers_that_overflow(column, made, tmp_path):
    (room,) = (one for one in ROOMS if one.name == "plots.csv")
    rows = made[room.name][0].read_text().splitlines()
    cells = rows[7].split(",")
    cells[column] = "1e308"
    (tmp_path / "plots.csv").write_text("\n".join([*rows[:7], ",".join(cells), *rows[8:]]))
    assert judge(room, tmp_path / "plots.csv") is None


def test_a_plot_of_a_scan_that_cannot_be(made, tmp_path):
    (room,) = (one for one in ROOMS if one.name == "live.npz")
    with np.load(made[room.name][0]) as saved:
        arrays = dict(saved)
    assert arrays["live.plots"].size
    arrays["live.plots"][0, 0] = 1e300
    np.savez(tmp_path / "live.npz", **arrays)
    assert judge(room, tmp_path / "live.npz") is None
    with pytest.raises(InvalidInputError):
        room.read(tmp_path / "live.npz")
