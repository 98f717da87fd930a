"""A plant that has something to be kept, on both databases."""

import shutil

import pytest

from app.services.backend import Backend
from tests.services.upkeep_plant import audited_twice


@pytest.fixture
def plant(backend: Backend, warm_kernels: None) -> Backend:
    return audited_twice(backend)


@pytest.fixture(autouse=True)
def _programs(request: pytest.FixtureRequest) -> None:
    """Backups of PostgreSQL need its client programs."""
    if "backup" in request.node.name and "postgresql" in request.node.name and shutil.which("pg_dump") is None:
        pytest.skip("no pg_dump on this machine")
