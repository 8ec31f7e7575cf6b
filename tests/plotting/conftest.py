"""One browser for all tests that need one, and a folder where their pictures are kept."""

import os
from pathlib import Path

import pytest

from tests.browser import opened


@pytest.fixture(scope="session")
def browser():
    with opened() as one:
        yield one


@pytest.fixture(scope="session")
def pictures(tmp_path_factory):
    """Folder of the screenshots: ASSOC_SCREENSHOTS, or one that pytest keeps for its last three runs."""
    named = os.environ.get("ASSOC_SCREENSHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("screenshots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder
