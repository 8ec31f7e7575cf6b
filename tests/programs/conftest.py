"""What tests of programs share."""

import subprocess
from collections.abc import Callable

import pytest

from assoc.simulation import simulate
from tests.running import here, program

Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def run() -> Run:
    return here


@pytest.fixture(scope="session")
def run_program() -> Run:
    return program


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "scene.npz"
    simulate("three-radar", 2, scans=6).save(path)
    return path
