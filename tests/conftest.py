"""What all tests share: where the recordings beside the project are, and which servers this machine has."""

import os
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """The folder of recordings beside the project; the test is skipped where it is not there."""
    if not SHARED.is_dir():
        pytest.skip("no folder ../shared with recordings beside the project")
    return SHARED


def servers_required() -> bool:
    """Whether PostgreSQL and Redis must be there (as in CI), instead of skipping their tests."""
    return os.environ.get("LOOPAUDIT_TEST_REQUIRE_SERVERS") == "1"
