"""A backup or a restore that ends half-way, by a full disk, a power cut or damage, leaves what was there whole."""

import resource
import shutil
import sqlite3
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import pytest
from sqlalchemy import update

from app.services.access import keys
from app.services.access.identity import Role
from app.services.backend import Backend
from app.services.upkeep import backup as backups
from app.settings import Settings
from app.storage import loops, schema, tables


def test_nothing_is_left_of_a_backup_that_failed(plant, tmp_path, monkeypatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(backups, "_copy_uploads", full)
    with pytest.raises(OSError, match="No space"):
        backups.backup(plant.settings, tmp_path / "there" / "kept")
    assert not list((tmp_path / "there").iterdir())


def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    def copied(source: BinaryIO, *_: object) -> None:
        raise OSError(28, "No space left on device", source.name)  # as it is told by sendfile

    monkeypatch.setattr(backups.shutil, "copyfileobj", copied)


def test_a_full_disk_is_told_by_what_a_backup_writes_there(plant, tmp_path, monkeypatch):
    full_disk(monkeypatch)
    with pytest.raises(OSError, match="No space") as raised:
        backups.backup(plant.settings, tmp_path / "there" / "kept")
    assert Path(raised.value.filename).is_relative_to(tmp_path / "there")


def test_a_full_disk_is_told_by_what_a_restore_writes_there(plant, tmp_path_factory, monkeypatch):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "kept"
    backups.backup(plant.settings, elsewhere)
    full_disk(monkeypatch)
    with pytest.raises(OSError, match="No space") as raised:
        backups.restore(plant.settings, elsewhere, force=True)
    assert Path(raised.value.filename).is_relative_to(plant.settings.data_dir)


def test_what_takes_no_more_of_a_copy_is_told_by_its_name(plant, tmp_path):
    """As a file system without large files: SQLite says no more than that something failed."""
    if not plant.database.is_sqlite:
        pytest.skip("pg_dump writes that one, and says so")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    try:
        with pytest.raises(OSError, match="cannot be written") as raised:
            backups.backup(plant.settings, tmp_path / "there" / "kept")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert Path(raised.value.filename).is_relative_to(tmp_path / "there")
    assert not list((tmp_path / "there").iterdir())


def test_where_there_is_no_room_for_the_exports_the_data_base_stays_as_it_was(plant, tmp_path_factory, monkeypatch):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "kept"
    backups.backup(plant.settings, elsewhere)
    keys.create_key(plant, "made since", Role.read, lifetime=None)
    copy = shutil.copyfileobj

    def copied(source: BinaryIO, target: BinaryIO, length: int) -> None:
        if Path(source.name).parent.name != "uploads":
            copy(source, target, length)
            return
        target.write(b"half")
        raise OSError(28, "No space left on device", target.name)

    monkeypatch.setattr(backups.shutil, "copyfileobj", copied)
    with pytest.raises(OSError, match="No space"):
        backups.restore(plant.settings, elsewhere, force=True)
    assert "made since" in [key.name for key in keys.list_keys(plant)]
    assert not list(plant.settings.data_dir.rglob("*.part"))


def test_a_full_disk_of_a_backup_is_not_the_data_base_that_cannot_be_used(empty_sqlite, tmp_path, monkeypatch):
    connect = sqlite3.connect

    def small(*arguments, **options):
        connection = connect(*arguments, **options)
        if "kept" in str(arguments[0]):
            connection.execute("PRAGMA max_page_count = 2")
        return connection

    monkeypatch.setattr(backups.sqlite3, "connect", small)
    with pytest.raises(OSError, match="No space") as raised:
        backups.backup(Settings(data_dir=empty_sqlite.parent), tmp_path / "kept")
    assert Path(raised.value.filename).is_relative_to(tmp_path)


class PowerCut(BaseException):
    """Nothing of what the program would still do happens."""


def broken_off(settings: Settings, way: str) -> None:
    """The database as a killed process leaves it: amid a transaction whose pages are in the file already, or with what
    was committed in the WAL alone."""
    file = settings.data_dir / "loopaudit.db"
    connection = sqlite3.connect(file, isolation_level=None)
    connection.execute(f"PRAGMA journal_mode = {way}")
    connection.execute("PRAGMA cache_size = 2")
    connection.execute("PRAGMA wal_autocheckpoint = 0")
    connection.execute("BEGIN IMMEDIATE")
    connection.execute("UPDATE keys SET name = 'killed'")
    rows = [("x" * 999,)] * 500
    connection.executemany("INSERT INTO trail (at, who, action, outcome) VALUES ('', ?, '', 'done')", rows)
    if way == "WAL":
        connection.execute("COMMIT")
    names = [path.name for path in settings.data_dir.glob("loopaudit.db*")]
    copies = {name: (settings.data_dir / name).read_bytes() for name in names}
    connection.close()
    for rest in ("", "-wal", "-shm", "-journal"):
        Path(f"{file}{rest}").unlink(missing_ok=True)
    for name, data in copies.items():
        (settings.data_dir / name).write_bytes(data)


def cut_at(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    """The power goes before that change to the names of files."""
    steps = iter(range(10**6))

    def counted(change):
        def or_cut(*arguments, **options):
            if next(steps) == step:
                raise PowerCut
            return change(*arguments, **options)

        return or_cut

    for name in ("unlink", "replace"):
        monkeypatch.setattr(Path, name, counted(getattr(Path, name)))


@pytest.mark.parametrize("step", range(6))
@pytest.mark.parametrize(("way", "was"), [("TRUNCATE", "me"), ("WAL", "killed")])
def test_a_data_base_that_was_broken_off_is_replaced_whole_or_not_at_all(
    empty_sqlite, tmp_path, monkeypatch, way, was, step
):
    settings = Settings(data_dir=tmp_path / "data")
    settings.prepare_folders()
    shutil.copy(empty_sqlite, settings.data_dir / "loopaudit.db")
    backend = Backend.open(settings)
    keys.create_key(backend, "kept", Role.admin, lifetime=None)
    with backend.database.write() as connection:
        loops.ensure(connection, ["KEPT"])
    backups.backup(settings, tmp_path / "kept")
    with backend.database.write() as connection:
        connection.execute(update(tables.keys).values(name="me"))
        connection.execute(update(tables.loops).values(tag="OLD"))
    backend.close()
    broken_off(settings, way)
    with monkeypatch.context() as patch, suppress(PowerCut):
        cut_at(patch, step)
        backups.restore(settings, tmp_path / "kept", force=True)
    with sqlite3.connect(settings.data_dir / "loopaudit.db") as after:
        assert after.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        found = after.execute("SELECT keys.name, loops.tag FROM keys, loops").fetchall()
    after.close()
    assert found in ([(was, "OLD")], [("kept", "KEPT")])


def test_names_of_what_was_written_are_on_disk_too(plant, tmp_path, monkeypatch):
    synced: list[Path] = []
    monkeypatch.setattr(backups, "sync_folder", synced.append)
    backups.backup(plant.settings, tmp_path / "new" / "kept")
    draft, parent = synced[1], tmp_path / "new"
    assert draft.match(f"{parent}/.kept.*.part")
    assert synced == [draft / "uploads", draft, parent, tmp_path]
    synced.clear()
    plant.database.close()
    backups.restore(plant.settings, tmp_path / "new" / "kept", force=True)
    of_sqlite = [plant.settings.data_dir] * 2  # before the new file takes its place, and after
    assert synced == [plant.settings.uploads_dir, *(of_sqlite if plant.database.is_sqlite else [])]


def test_a_data_base_that_is_damaged_is_replaced(empty_sqlite, tmp_path):
    settings = Settings(data_dir=tmp_path / "data")
    settings.prepare_folders()
    file = settings.data_dir / "loopaudit.db"
    shutil.copy(empty_sqlite, file)
    backups.backup(settings, tmp_path / "kept")
    file.write_bytes(b"no database at all" * 999)
    Path(f"{file}-journal").write_bytes(b"no journal")
    assert backups.restore(settings, tmp_path / "kept", force=True).schema == schema.newest_revision()
