"""An address of SQLite may be a path or a URI: both mean the file."""

from pathlib import Path

import pytest
from sqlalchemy import make_url

from app.queue.jobs import queue_names
from app.services.upkeep.backup import backup, restore
from app.services.upkeep.tables import migrate, refuse_unmigrated
from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import Database, loops


def as_uri(folder: Path) -> Settings:
    return Settings(data_dir=folder, database_url=f"sqlite:///file:{folder}/loopaudit.db?uri=true")


@pytest.mark.parametrize(
    ("address", "file"),
    [
        ("sqlite:////data/plant 1.db", "/data/plant 1.db"),
        ("sqlite:///plant.db", "plant.db"),
        ("sqlite:///file:/data/plant%201.db?uri=true", "/data/plant 1.db"),
        ("sqlite:///file:///data/plant.db?uri=true", "/data/plant.db"),
        ("sqlite:///file:plant.db?mode=ro&uri=yes", "plant.db"),
        ("sqlite:///file:plant.db", "file:plant.db"),
        ("sqlite:///file:plant.db?mode=ro&uri=false", "file:plant.db"),
        ("sqlite://", "."),
    ],
)
def test_the_file_of_an_address(address: str, file: str) -> None:
    assert file_of(make_url(address)) == Path(file)


@pytest.mark.filterwarnings("ignore:Query string argument")
def test_the_file_is_the_one_that_the_driver_opens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for address in ("sqlite:///file:one.db", "sqlite:///file:two.db?mode=ro", "sqlite:///file:three.db?uri=true"):
        database = Database(address)
        with database.write() as connection:
            connection.exec_driver_sql("CREATE TABLE told (word TEXT)")
        assert file_of(database.url).is_file()
        assert database.takes_writes()
        database.close()


def test_a_plant_that_is_named_by_a_uri_is_kept_and_comes_back(tmp_path: Path) -> None:
    settings, other = as_uri(tmp_path / "one"), as_uri(tmp_path / "other")
    migrate(settings)
    refuse_unmigrated(settings)
    database = Database(settings.resolved_database_url)
    with database.write() as connection:
        loops.ensure(connection, ["FIC1"])
    database.close()
    backup(settings, tmp_path / "kept")
    restore(other, tmp_path / "kept")
    there = Database(f"sqlite:///{tmp_path}/other/loopaudit.db")
    with there.read() as connection:
        assert connection.exec_driver_sql("SELECT tag FROM loops").scalars().all() == ["FIC1"]
    there.close()


def test_both_forms_meet_at_the_broker(tmp_path: Path) -> None:
    assert queue_names(as_uri(tmp_path)) == queue_names(Settings(data_dir=tmp_path))
