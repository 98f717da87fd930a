"""Readiness says whether the data base takes writes, and waits for nobody to say it."""

import os
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from app.services.backend import Backend
from app.services.upkeep.readiness import readiness
from app.services.upkeep.tables import migrate
from app.settings import Settings


@pytest.mark.postgres
def test_connections_that_are_all_busy_writing_are_not_waited_for(tmp_path: Path, emptied_postgres: str) -> None:
    backend = Backend.open(Settings(data_dir=tmp_path, database_url=emptied_postgres, pool_size=1))
    try:
        assert readiness(backend).checks["writes"] == "ok"
        with ExitStack() as busy:
            for _ in range(2):
                busy.enter_context(backend.database.write())
            begun = time.monotonic()
            found = readiness(backend)
            took_s = time.monotonic() - begun
        assert (found.state, found.checks["writes"]) == ("ready", "busy")
        assert took_s < 5.0
        assert readiness(backend).checks["writes"] == "ok"
    finally:
        backend.close()


def test_connections_that_are_all_busy_reading_are_not_waited_for(backend: Backend) -> None:
    assert readiness(backend).checks["database"] == "ok"
    with ExitStack() as busy:
        while not backend.database.is_read_by_all():
            busy.enter_context(backend.database.read())
        begun = time.monotonic()
        found = readiness(backend)
        took_s = time.monotonic() - begun
    assert (found.state, found.checks["database"], found.checks["schema"]) == ("degraded", "busy", "not known")
    assert took_s < 5.0
    assert readiness(backend).state == "ready"


@pytest.mark.parametrize("address", ["sqlite:///{folder}/plant.db", "sqlite:///file:{folder}/plant.db?uri=true"])
def test_a_file_is_read_only_where_it_or_its_folder_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    settings = Settings(data_dir=tmp_path, database_url=address.format(folder=tmp_path))
    migrate(settings)
    backend = Backend.open(settings)
    try:
        found = readiness(backend)
        assert (found.state, found.checks["writes"]) == ("ready", "ok")
        for place in (tmp_path, tmp_path / "plant.db"):
            with monkeypatch.context() as mounted:
                mounted.setattr(os, "access", lambda path, mode, place=place: str(path) != str(place))
                found = readiness(backend)
                assert (found.state, found.checks["writes"]) == ("degraded", "read-only")
    finally:
        backend.close()
