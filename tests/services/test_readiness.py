"""Readiness says whether the database takes writes, and waits for nobody to say it."""

import logging
import os
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from app.http.probing import PATIENCE_S
from app.queue import publishing
from app.queue.publishing import Queue
from app.services.backend import Backend
from app.services.upkeep import doctor
from app.services.upkeep.readiness import lacking, readiness
from app.services.upkeep.tables import migrate, refuse_unmigrated
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
                growth = doctor.growth(backend)
                assert (growth.state, "cannot be written" in growth.found) == ("problem", True)
    finally:
        backend.close()


@pytest.mark.parametrize("says", ["mode=ro", "immutable=1"])
def test_an_address_that_asks_for_no_writes_is_told_at_the_start_and_later(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, says: str
) -> None:
    caplog.set_level(logging.WARNING)  # whatever a test before has configured
    migrate(Settings(data_dir=tmp_path))
    assert not caplog.records
    settings = Settings(data_dir=tmp_path, database_url=f"sqlite:///file:{tmp_path}/loopaudit.db?{says}&uri=true")
    refuse_unmigrated(settings)
    assert ["takes no writes" in record.getMessage() for record in caplog.records] == [True]
    backend = Backend.open(settings)
    try:
        assert readiness(backend).checks["writes"] == "read-only"
    finally:
        backend.close()
    growth = next(check for check in doctor.examine(settings) if check.name == "growth")
    assert (growth.state, "mode=ro" in growth.advice) == ("problem", True)


def test_a_data_folder_that_takes_nothing_is_told(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its pages can be read; exports are refused."""
    folder = backend.settings.uploads_dir
    assert readiness(backend).checks["data_folder"] == "ok"
    with monkeypatch.context() as mounted:
        mounted.setattr(os, "access", lambda path, mode: mode == os.F_OK or Path(path) != folder)
        found = readiness(backend)
    assert (found.state, found.checks["data_folder"]) == ("degraded", "read-only")
    assert lacking(found) == []
    folder.rename(folder.with_name("away"))
    found = readiness(backend)
    folder.with_name("away").rename(folder)
    assert (found.state, found.checks["data_folder"]) == ("not_ready", "gone")
    assert lacking(found) == ["the data folder is not there"]


def test_a_broker_that_hangs_is_away_and_asked_once(backend: Backend, monkeypatch: pytest.MonkeyPatch) -> None:
    """As while a server of names is away: the database is well all the same, and says so in time."""
    asked: list[int] = []
    goes_on = threading.Event()

    def hang(self: Queue) -> None:
        asked.append(1)
        goes_on.wait(30)

    assert publishing.HANGS_AFTER_S < PATIENCE_S
    monkeypatch.setattr(publishing, "HANGS_AFTER_S", 0.2)
    with monkeypatch.context() as patch:
        patch.setattr(Queue, "_application", property(hang))
        try:
            for _ in range(2):
                found = readiness(backend)
                assert (found.state, found.checks["broker"], found.checks["database"]) == ("degraded", "away", "ok")
        finally:
            goes_on.set()
    assert len(asked) == 1
