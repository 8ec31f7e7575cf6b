"""Programs are run as programs: in a process of their own."""

import subprocess
import sys
from collections.abc import Callable

import pytest

from assoc.simulation import simulate

Run = Callable[..., "subprocess.CompletedProcess[str]"]


def program(*words: object, cwd: object = None) -> subprocess.CompletedProcess[str]:
    """Run ``python -W error -m words``."""
    command = [sys.executable, "-W", "error", "-m", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=cwd)


@pytest.fixture(scope="session")
def run() -> Run:
    return program


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "scene.npz"
    simulate("three-radar", 2, scans=6).save(path)
    return path
