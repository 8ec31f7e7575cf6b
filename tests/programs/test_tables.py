"""Tables on terminals of several widths: no number is cut; in a pipe: plain columns."""

import re
from collections import Counter

import pytest

from assoc._cli.table import table_lines

WIDTHS = (60, 80, 120, 200)
HEADERS = ["solver", "alpha", "runs", "mean cost", "95 %", "mean gap", "95 %", "optimal %", "95 %", "ms", "95 %"]
ROWS = [
    ["aco", str(a), "400", f"{-107.3407 * a:.4f}", "-1121.8214 .. -1084.1626", "0.00123", "0.0011 .. 0.0013",
     "99.75", "99.25 .. 100.00", "0.73", "0.685 .. 0.772"]
    for a in range(1, 5)
]  # fmt: skip


@pytest.mark.parametrize("width", WIDTHS)
def test_no_word_is_cut(width):
    lines = table_lines(HEADERS, ROWS, ["solver"], width)
    assert max(map(len, lines)) <= width and not any(line.endswith(" ") for line in lines)
    shown = Counter(" ".join(lines).split())
    assert all(shown[word] >= count for word, count in Counter(" ".join(sum(ROWS, [])).split()).items())
    assert (lines[0].split()[0] == "solver") and ("─" in lines[1]) == (width >= 120)


def test_a_pipe_gets_plain_columns():
    head, *lines = table_lines(HEADERS, ROWS, ["solver"], None)
    assert [re.split("  +", line) for line in (head, *lines)] == [HEADERS, *ROWS]
    assert head.startswith("solver  alpha  runs") and lines[0].startswith("aco         1   400  -107.3407")


@pytest.mark.parametrize("width", [3, 80, None])
def test_control_characters_are_printed_as_escapes(width):
    words = " ".join(table_lines(["name", "n"], [["a\x1b[31m\n", "[b]"]], [], width)).split()
    assert r"a\x1b[31m\n" in words and "[b]" in words
