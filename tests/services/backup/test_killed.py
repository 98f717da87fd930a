"""A backup that was killed leaves a part: the next one into the folder around it removes that, and no living one's."""

import fcntl
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.services.upkeep import backup as backups
from app.services.upkeep import draft_folder
from app.settings import Settings
from tests import forked

AMID = """
import sys, time
from pathlib import Path
from app.services.upkeep import backup
from app.settings import Settings

def stands(*_):
    print("amid", flush=True)
    time.sleep(600)

backup._copy_uploads = stands
backup.backup(Settings(data_dir=Path(sys.argv[1])), Path(sys.argv[2]))
"""


@pytest.fixture
def settings(empty_sqlite: Path, tmp_path: Path) -> Settings:
    made = Settings(data_dir=tmp_path / "data")
    made.prepare_folders()
    shutil.copy(empty_sqlite, made.data_dir / "loopaudit.db")
    return made


@pytest.fixture
def amid(settings: Settings, tmp_path: Path) -> Iterator[forked.Forked]:
    """A backup of a night, amid its exports."""
    log = tmp_path / "log"
    with log.open("wb") as told:
        process = forked.script(AMID, settings.data_dir, tmp_path / "kept" / "monday", stdout=told, stderr=told)
    try:
        until(log.read_text)
        assert log.read_text() == "amid\n"
        yield process
    finally:
        process.kill()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_a_killed_backup_left_goes_with_the_next_one(settings, amid, tmp_path):
    (part,) = (tmp_path / "kept").iterdir()
    amid.kill()
    assert (part / "loopaudit.db").stat().st_size
    done = backups.backup(settings, tmp_path / "kept" / "tuesday")
    assert done.removed == (part,)
    assert names(tmp_path / "kept") == ["tuesday"]
    assert names(tmp_path / "kept" / "tuesday") == ["loopaudit.db", "manifest.json", "uploads"]


def test_what_a_living_backup_writes_stays_however_old_it_is(settings, amid, tmp_path):
    (part,) = (tmp_path / "kept").iterdir()
    os.utime(part, (0, 0))
    for name in ("tuesday", "monday"):
        assert backups.backup(settings, tmp_path / "kept" / name).removed == ()
    assert (part / "loopaudit.db").stat().st_size
    assert names(tmp_path / "kept") == [part.name, "monday", "tuesday"]


def test_what_is_not_of_a_backup_is_left_alone(settings, tmp_path):
    there = tmp_path / "kept"
    (there / ".mine.part").mkdir(parents=True)
    (there / ".link.part").symlink_to(there / ".mine.part")
    (there / ".file.part").write_bytes(b"")
    os.utime(there / ".mine.part", (0, 0))
    assert backups.backup(settings, there / "tuesday").removed == ()
    assert names(there) == [".file.part", ".link.part", ".mine.part", "tuesday"]


def test_a_folder_that_only_begins_like_a_part_is_somebodys_own(settings, tmp_path):
    """What versions without a lock left is known by the whole of its name."""
    there = tmp_path / "kept"
    for name in (".monday.my own notes.part", ".monday.abcd1234.part"):
        (there / name).mkdir(parents=True)
        os.utime(there / name, (0, 0))
    assert backups.backup(settings, there / "monday").removed == (there / ".monday.abcd1234.part",)
    assert names(there) == [".monday.my own notes.part", "monday"]


def test_a_part_that_another_user_keeps_to_himself_does_not_hold_a_backup_up(settings, tmp_path, monkeypatch):
    """Into its folder nobody else may look, not even for a lock."""
    theirs = tmp_path / "kept" / ".theirs.abcd1234.part"
    theirs.mkdir(parents=True)
    looked = Path.is_file

    def refused(path: Path) -> bool:
        if path.parent == theirs:
            raise PermissionError(13, "Permission denied", str(path))
        return looked(path)

    monkeypatch.setattr(draft_folder.Path, "is_file", refused)
    assert backups.backup(settings, tmp_path / "kept" / "tuesday").removed == ()
    assert theirs.is_dir()


def test_a_link_in_a_part_goes_and_what_it_leads_to_stays(settings, amid, tmp_path):
    amid.kill()
    (part,) = (tmp_path / "kept").iterdir()
    (part / "uploads").symlink_to(settings.data_dir)
    assert backups.backup(settings, tmp_path / "kept" / "tuesday").removed == (part,)
    assert (settings.data_dir / "loopaudit.db").is_file()
    assert names(tmp_path / "kept") == ["tuesday"]


def test_a_removal_that_was_killed_goes_on(settings, amid, tmp_path, monkeypatch):
    amid.kill()
    (part,) = (tmp_path / "kept").iterdir()
    with monkeypatch.context() as patch:
        patch.setattr(draft_folder.shutil, "rmtree", lambda _, **__: None)
        backups.backup(settings, tmp_path / "kept" / "tuesday")
    assert names(part) == ["loopaudit-backup.lock"]
    assert backups.backup(settings, tmp_path / "kept" / "wednesday").removed == (part,)
    assert names(tmp_path / "kept") == ["tuesday", "wednesday"]


def test_without_locks_a_part_is_left_when_it_is_a_day_old(settings, amid, tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    amid.kill()
    monkeypatch.setattr(fcntl, "flock", refuse)
    (part,) = (tmp_path / "kept").iterdir()
    assert backups.backup(settings, tmp_path / "kept" / "tuesday").removed == ()
    os.utime(part, (0, 0))
    assert backups.backup(settings, tmp_path / "kept" / "wednesday").removed == (part,)


def test_a_backup_that_was_killed_at_its_very_end_comes_back(settings, tmp_path, monkeypatch):
    monkeypatch.setattr(draft_folder.Path, "unlink", lambda *_, **__: None)
    backups.backup(settings, tmp_path / "kept")
    assert (tmp_path / "kept" / "loopaudit-backup.lock").is_file()
    assert backups.restore(settings, tmp_path / "kept", force=True).files == 1


def test_what_a_killed_restore_left_among_the_exports_goes_with_the_next_one(settings, tmp_path):
    """It may be of an export that is in no backup that is brought back again."""
    backups.backup(settings, tmp_path / "kept")
    left = settings.uploads_dir / f".{'b' * 64}.part"
    others = [settings.uploads_dir / name for name in (f".{'b' * 63}.part", ".notes.part", "mine")]
    for file in (left, *others):
        file.write_bytes(b"half of it")
    folder, link = (settings.uploads_dir / f".{digit * 64}.part" for digit in "cd")  # which no restore makes
    folder.mkdir()
    link.symlink_to(others[-1])
    backups.restore(settings, tmp_path / "kept", force=True)
    assert [file.exists() for file in (left, *others, folder, link)] == [False, True, True, True, True, True]


def test_the_command_says_what_it_removed(settings, amid, tmp_path, monkeypatch):
    from typer.testing import CliRunner

    from app.cli.main import cli

    amid.kill()
    (part,) = (tmp_path / "kept").iterdir()
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(settings.data_dir))
    done = CliRunner().invoke(cli, ["backup", str(tmp_path / "kept" / "tuesday")])
    assert f"removed {part}" in done.stderr


def test_a_restore_writes_through_no_link_that_stands_where_it_writes(settings, tmp_path):
    """Whoever runs it may write where whoever made the link may not."""
    exports, kept, elsewhere = settings.uploads_dir, tmp_path / "kept" / "monday", tmp_path / "elsewhere"
    export = exports / ("a" * 64)
    export.write_bytes(b"an export")
    backups.backup(settings, kept)
    elsewhere.write_text("somebody's own")
    places = (settings.data_dir / "loopaudit.db", export)
    for place in places:
        place.with_name(f".{place.name}.part").symlink_to(elsewhere)
        place.unlink()
        place.symlink_to(elsewhere)
    backups.restore(settings, kept, force=True)
    assert elsewhere.read_text() == "somebody's own"
    assert (export.read_bytes(), places[0].read_bytes()[:6]) == (b"an export", b"SQLite")
    assert not any(place.is_symlink() for place in places)


def test_a_restore_writes_through_no_link_that_is_made_while_it_begins(settings, tmp_path, monkeypatch):
    exports, kept, elsewhere = settings.uploads_dir, tmp_path / "kept" / "monday", tmp_path / "elsewhere"
    export = exports / ("a" * 64)
    export.write_bytes(b"an export")
    backups.backup(settings, kept)
    elsewhere.write_text("somebody's own")
    draft, unlink = export.with_name(f".{export.name}.part"), Path.unlink

    def linked_again(path: Path, missing_ok: bool = False) -> None:
        unlink(path, missing_ok=missing_ok)
        if path == draft:
            path.symlink_to(elsewhere)

    monkeypatch.setattr(Path, "unlink", linked_again)
    with pytest.raises(FileExistsError):
        backups.restore(settings, kept, force=True)
    assert elsewhere.read_text() == "somebody's own"


def test_a_program_of_postgresql_ends_with_a_restore_that_is_killed(tmp_path):
    """It would bring the backup back all the same, over what was taken since."""
    program = tmp_path / "pg_restore"
    program.write_text("#!/bin/sh\necho $$ > $0.pid\nexec sleep 60\n")
    program.chmod(0o755)
    started = tmp_path / "pg_restore.pid"
    runs = (
        "from sqlalchemy import make_url\n"
        "from app.services.upkeep.backup import _run, program_address\n"
        "_run(['pg_restore'], program_address(make_url('postgresql:///none')))\n"
    )
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    with subprocess.Popen([sys.executable, "-c", runs], env=environment) as restoring:
        until(lambda: started.is_file() and started.read_text())
        restoring.kill()
    until(lambda: not Path(f"/proc/{started.read_text().strip()}").exists())


def until(holds: Callable[[], object]) -> None:
    ends = time.monotonic() + 20
    while not holds():
        assert time.monotonic() < ends
        time.sleep(0.02)
