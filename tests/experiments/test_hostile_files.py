"""Instances and proofs from anywhere: whatever they hold, one line, exit code 2, and not all of the memory."""

import json
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


INSTANCES = {
    "no text": b"\xff\xfe\x00",
    "a huge count": (HEAD + "999999999\n0 1 0\n").encode(),
    "a count beyond any": (HEAD + "9" * 400_000 + "\n").encode(),
    "huge sizes": GOOD.replace("sizes 1 2", "sizes 999999999 999999999").encode(),
    "not a number": GOOD.replace("-3.5", "nan").encode(),
    "a huge exponent": GOOD.replace("-3.5", "1e99999999").encode(),
    "a huge integer": GOOD.replace("-3.5", "9" * 1_000_000).encode(),
    "an index out of range": GOOD.replace("-3.5 1 1", "-3.5 1 3").encode(),
    "cut": GOOD[:60].encode(),
}


@pytest.mark.parametrize("how", INSTANCES)
def test_hostile_instances(how, tmp_path):
    (tmp_path / "i.txt").write_bytes(INSTANCES[how])
    (tmp_path / "s.txt").write_text("assoc-solution 1\n1 1\n0 2\n")
    _refused(run(tmp_path / "i.txt", tmp_path / "s.txt"), "i.txt")


@pytest.mark.parametrize(
    "content",
    [
        "{" + '"a":' * 200_000,
        json.dumps({**PROOF, "trees": [[[[]]]]}),
        json.dumps({**PROOF, "trees": [{"rows": [[1, 1], [2, 1]], "nodes": {}}]}),
        json.dumps({**PROOF, "tuples": [[1, "9" * 100_000]]}),
        json.dumps({**PROOF, "cost": float("nan")}),
        json.dumps({**PROOF, "multipliers": [[[float("inf")], [0, 0]]]}),
        json.dumps(PROOF)[:-20],
        "assoc-solution 1\n1 " + "9" * 1_000_000 + "\n",
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
