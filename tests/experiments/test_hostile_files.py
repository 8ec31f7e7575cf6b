"""Instances and proofs from anywhere: whatever they hold, one line, exit code 2, and not all of the memory."""

import json
import lzma
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from assoc import check

GOOD = "assoc-problem 1\nsizes 1 2\ndummies yes\ntuples 4\n-3.5 1 1\n0.0 1 0\n0.0 0 1\n0.0 0 2\n"
PROOF = {
    "format": "assoc-proof",
    "version": 1,
    "tuples": [[1, 1], [0, 2]],
    "cost": "-3.5",
    "multipliers": [[[-3.5], [0, 0]]],
    "trees": [],
}
HEAD = "assoc-problem 1\nsizes 2 2\ndummies yes\ntuples "
BYTES = 1_500_000_000


def run(*words: object) -> subprocess.CompletedProcess[str]:
    """Run the file alone, with 1.5 GB of memory at the most."""
    return subprocess.run(
        [sys.executable, "-I", "-S", check.__file__, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=600,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES)),
    )


def packed(size: int) -> bytes:
    """A small file that unpacks to so many bytes."""
    packer = lzma.LZMACompressor(preset=0)
    piece = b"0.0 1 0\n" * 125_000
    head = packer.compress(HEAD.encode() + b"9\n")
    return head + b"".join(packer.compress(piece) for _ in range(size // len(piece))) + packer.flush()


INSTANCES = {
    "empty": b"",
    "no text": b"\xff\xfe\x00",
    "a huge count": (HEAD + "999999999\n0 1 0\n").encode(),
    "a count beyond any": (HEAD + "9" * 400_000 + "\n").encode(),
    "huge sizes": GOOD.replace("sizes 1 2", "sizes 999999999 999999999").encode(),
    "sizes beyond any": GOOD.replace("sizes 1 2", "sizes 1 " + "2" * 5000).encode(),
    "a negative size": GOOD.replace("sizes 1 2", "sizes -1 2").encode(),
    "many sensors": GOOD.replace("sizes 1 2", "sizes " + "1 " * 500_000).encode(),
    "not a number": GOOD.replace("-3.5", "nan").encode(),
    "infinity": GOOD.replace("-3.5", "inf").encode(),
    "a huge exponent": GOOD.replace("-3.5", "1e99999999").encode(),
    "a huge integer": GOOD.replace("-3.5", "9" * 1_000_000).encode(),
    "a huge index": GOOD.replace("-3.5 1 1", "-3.5 1 " + "9" * 1_000_000).encode(),
    "an index out of range": GOOD.replace("-3.5 1 1", "-3.5 1 3").encode(),
    "another number of indices": GOOD.replace("-3.5 1 1", "-3.5 1").encode(),
    "cut": GOOD[:60].encode(),
}


@pytest.mark.parametrize("how", INSTANCES)
def test_hostile_instances(how, tmp_path):
    (tmp_path / "i.txt").write_bytes(INSTANCES[how])
    (tmp_path / "s.txt").write_text("assoc-solution 1\n1 1\n0 2\n")
    _refused(run(tmp_path / "i.txt", tmp_path / "s.txt"), "i.txt")


@pytest.mark.slow
def test_packed_files_that_are_cut_or_unpack_to_too_much(tmp_path):
    (tmp_path / "s.txt").write_text("assoc-solution 1\n1 1\n0 2\n")
    whole = lzma.compress(GOOD.encode())
    for name, content in {
        "cut": whole[:-9],
        "spoiled": whole[:20] + b"x" + whole[21:],
        "large": packed(250_000_000),
    }.items():
        (tmp_path / f"{name}.txt.xz").write_bytes(content)
        assert len(content) < 100_000
        _refused(run(tmp_path / f"{name}.txt.xz", tmp_path / "s.txt"), name)


@pytest.mark.parametrize(
    "content",
    [
        "{" + '"a":' * 200_000,
        '{"format":' + "[" * 1_000_000,
        json.dumps({**PROOF, "trees": [[[[]]]]}),
        json.dumps({**PROOF, "trees": [{"rows": [[1, 1], [2, 1]], "nodes": {}}]}),
        json.dumps({**PROOF, "trees": {"rows": 1}}),
        json.dumps({**PROOF, "tuples": [[1, "9" * 100_000]]}),
        json.dumps({**PROOF, "tuples": {"1": 1}}),
        json.dumps({**PROOF, "cost": float("nan")}),
        json.dumps({**PROOF, "cost": ["-3.5"]}),
        json.dumps({**PROOF, "multipliers": [[[float("inf")], [0, 0]]]}),
        json.dumps({**PROOF, "multipliers": None}),
        json.dumps({**PROOF, "multipliers": [[["9" * 1000], [0, 0]]]}),
        json.dumps({**PROOF, "bound": {}}),
        json.dumps(PROOF)[:-20],
        "assoc-solution 1\n1 " + "9" * 1_000_000 + "\n",
        "assoc-solution 1\ncost 1e999999\n1 1\n0 2\n",
    ],
    # names of tests are given to the programs that they start, whole by older pytest
    ids=lambda content: content[:24],
)
def test_hostile_proofs(content, tmp_path):
    (tmp_path / "i.txt").write_text(GOOD)
    digest = check.read_problem(str(tmp_path / "i.txt")).digest
    content = content.replace('"format": "assoc-proof"', f'"format": "assoc-proof", "problem": "{digest}"')
    (tmp_path / "p.json").write_text(content)
    _refused(run(tmp_path / "i.txt", tmp_path / "p.json"), "p.json")


@pytest.mark.slow
def test_a_tree_without_end_is_refused(tmp_path):
    """Nodes that are shared would double the work at each, and a chain of them would keep all its siblings."""
    (tmp_path / "i.txt").write_text(GOOD)
    digest = check.read_problem(str(tmp_path / "i.txt")).digest
    tree = {"rows": [[1, 1], [2, 1]], "target": "-4", "cuts": []}
    pair = [[1, 1], [2, 1]]
    shared = [{"pair": pair, "children": [i + 1, i + 1]} for i in range(60)]
    chain = [{"pair": pair, "children": [2 * i + 1, 2 * i + 2]} for i in range(100_000)]
    for nodes, words in ((shared, "children of its own"), (chain, "deeper than")):
        proof = {**PROOF, "problem": digest, "trees": [{**tree, "nodes": nodes}]}
        (tmp_path / "p.json").write_text(json.dumps(proof))
        done = run(tmp_path / "i.txt", tmp_path / "p.json")
        _refused(done, "p.json")
        assert words in done.stderr


def _refused(done: subprocess.CompletedProcess[str], name: str) -> None:
    assert done.returncode == 2, done.stdout + done.stderr
    assert done.stdout == "" and done.stderr.count("\n") == 1 and len(done.stderr) < 400
    assert Path(done.stderr.split(": ")[0]).name.startswith(name)
