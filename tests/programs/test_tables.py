"""Tables on terminals of several widths: no number is cut; into a pipe: plain columns."""

import re

import pytest

from assoc._cli.table import fitted_lines

WIDTHS = (60, 80, 120, 200)
HEADERS = ["solver", "alpha", "runs", "mean cost", "95 %", "mean gap", "95 %", "optimal %", "95 %", "ms", "95 %"]
ROWS = [
    ["aco", str(a), "400", f"{-107.3407 * a:.4f}", "-1121.8214 .. -1084.1626", "0.00123", "0.0011 .. 0.0013",
     "99.75", "99.25 .. 100.00", "0.73", "0.685 .. 0.772"]
    for a in range(1, 5)
]  # fmt: skip


@pytest.mark.parametrize("width", WIDTHS)
def test_no_cell_is_cut(width):
    lines = [*fitted_lines(HEADERS, ROWS, width, keys=2, joined=["95 %"])]
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for row in ROWS:
        for cell in row:
            assert re.search(rf"(?<!\S){re.escape(cell)}(?!\S)", text), cell
    # an interval stands behind its value
    for value, interval in zip(ROWS[0][3::2], ROWS[0][4::2], strict=True):
        assert re.search(rf"{re.escape(value)} +{re.escape(interval)}", text)


@pytest.mark.parametrize("width", [3, 80])
def test_control_characters_are_printed_as_escapes(width):
    lines = [*fitted_lines(["name", "n"], [["a\x1b[31m\n", "1"]], width)]
    assert lines[-1 if width == 80 else 0].split()[-2 if width == 80 else -1] == r"a\x1b[31m\n"
