"""A data folder in a place of /etc/fstab that is not mounted: no database is begun there, whatever would begin one."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from app.errors import RequestError
from app.services import mounts
from app.services.mounts import unmounted_place
from app.services.upkeep import backup as backups
from app.services.upkeep import doctor
from app.services.upkeep.tables import migrate
from app.settings import Settings

Tables = Callable[[str, str], None]


@pytest.fixture
def tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tables:
    """Puts fstab and what is mounted, with `@` for the folder of the test."""
    monkeypatch.setattr(mounts, "FSTAB", tmp_path / "fstab")
    monkeypatch.setattr(mounts, "MOUNTED", tmp_path / "mounts")

    def put(fstab: str, mounted: str) -> None:
        for name, text in (("fstab", fstab), ("mounts", mounted)):
            (tmp_path / name).write_text(text.replace("@", str(tmp_path)))

    return put


@pytest.mark.parametrize(
    ("fstab", "mounted", "away"),
    [
        ("/dev/sdb1 @/srv ext4 defaults 0 2\n", "", "srv"),
        ("\t/dev/sdb1\t@/srv/\text4 noauto\n", "/dev/sda1 / ext4 rw\n", "srv"),
        ("/dev/sdb1 @/srv/plant/data ext4\n", "", "srv/plant/data"),
        ("/dev/sdb1 @/srv/plant/data/more ext4\n", "", None),
        ("/dev/sdb1 @/srv ext4\n", "/dev/sdb1 @/srv ext4 rw\n", None),
        ("@/disk/a @/srv none bind 0 0\n", "/dev/sda1 @/srv ext4 rw\n", None),  # as on the disk of the folder above
        ("/dev/sdb1 @/srv ext4\n", "/dev/sdc1 @/srv/plant ext4 rw\n", None),  # mounted by something else
        ("/dev/sdb1 @/srv ext4\n/dev/sdc1 @/srv/plant ext4\n", "/dev/sdb1 @/srv ext4 rw\n", "srv/plant"),
        ("# /dev/sdb1 @/srv ext4\n/swap.img none swap sw\nUUID=1 swap swap sw\nfloppy\n\n", "", None),
        ("/dev/sdb1 @/sr ext4\n/dev/sdb1 / ext4\n", "", None),
    ],
)
def test_what_is_away_is_the_nearest_place_that_is_to_be_mounted_and_is_not(
    tmp_path: Path, tables: Tables, fstab: str, mounted: str, away: str | None
) -> None:
    tables(fstab, mounted)
    assert unmounted_place(tmp_path / "srv" / "plant" / "data") == (away and tmp_path / away)


def test_blanks_of_a_place_are_written_in_octal(tmp_path: Path, tables: Tables) -> None:
    tables("/dev/sdb1 @/our\\040plant ext4\n", "")
    assert unmounted_place(tmp_path / "our plant") == tmp_path / "our plant"
    tables("/dev/sdb1 @/our\\040plant ext4\n", "/dev/sdb1 @/our\\040plant ext4 rw\n")
    assert unmounted_place(tmp_path / "our plant") is None


def test_links_are_followed(tmp_path: Path, tables: Tables) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "data").symlink_to(tmp_path / "disk" / "loopaudit")  # which is not there while the mount is away
    (tmp_path / "srv").symlink_to(tmp_path / "disk")
    tables("/dev/sdb1 @/disk ext4\n", "")
    assert unmounted_place(tmp_path / "data") == tmp_path / "disk"
    tables("/dev/sdb1 @/srv ext4\n", "/dev/sdb1 @/disk ext4 rw\n")
    assert unmounted_place(tmp_path / "srv" / "loopaudit") is None


def test_without_tables_nothing_is_known_to_be_away(tmp_path: Path, tables: Tables) -> None:
    assert unmounted_place(tmp_path / "srv") is None


def test_a_path_from_here_is_one_too(tmp_path: Path, tables: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    tables("/dev/sdb1 @/srv ext4\n", "")
    assert unmounted_place(Path("srv/loopaudit")) == tmp_path / "srv"


def test_no_mount_of_others_is_looked_at(tmp_path: Path, tables: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    """A share whose server is away would keep `serve` from ever coming up."""
    looked_at: list[str] = []
    lstat = os.lstat
    monkeypatch.setattr(os, "lstat", lambda path, **more: (looked_at.append(os.fspath(path)), lstat(path, **more))[1])
    tables("server:/x @/share nfs\n/dev/sdb1 @/srv ext4\n", "server:/x @/share nfs4 rw\n")
    assert unmounted_place(tmp_path / "srv") == tmp_path / "srv"
    assert str(tmp_path / "srv") in looked_at
    assert str(tmp_path / "share") not in looked_at


def test_neither_migrate_nor_restore_begins_a_database_there(tmp_path: Path, tables: Tables) -> None:
    kept = Settings(data_dir=tmp_path / "kept")
    migrate(kept)
    backups.backup(kept, tmp_path / "backup")
    tables("/dev/sdb1 @/srv ext4\n", "")
    there = Settings(data_dir=tmp_path / "srv" / "loopaudit")
    elsewhere = Settings(data_dir=tmp_path / "usr", database_url=f"sqlite:///{tmp_path}/srv/plant.db")
    for settings in (there, elsewhere):
        for begin in (migrate, lambda these: backups.restore(these, tmp_path / "backup")):
            with pytest.raises(RequestError, match=f"{tmp_path}/srv, which .* is not mounted") as refused:
                begin(settings)
            assert refused.value.code == "not_mounted"
    assert not (tmp_path / "srv").exists()
    assert not (tmp_path / "usr").exists()
    tables("/dev/sdb1 @/srv ext4\n", "/dev/sdb1 @/srv ext4\n")
    assert backups.restore(there, tmp_path / "backup").schema == migrate(there)


def test_a_database_that_is_there_already_goes_on(tmp_path: Path, tables: Tables) -> None:
    """As where a folder below a place for other disks has always been in use."""
    settings = Settings(data_dir=tmp_path / "srv" / "loopaudit")
    migrate(settings)
    tables("/dev/sdb1 @/srv ext4 noauto\n", "")
    assert migrate(settings)


def test_the_doctor_sends_nobody_to_begin_one(tmp_path: Path, tables: Tables) -> None:
    tables("/dev/sdb1 @/srv ext4\n", "")
    checks = doctor.examine(Settings(data_dir=tmp_path / "srv" / "loopaudit"))
    found = next(check for check in checks if check.name == "database")
    assert (found.state, f"{tmp_path}/srv, which" in found.found) == ("problem", True)
    assert found.advice.startswith("mount it")
