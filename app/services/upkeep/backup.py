"""Backup and restore: the database as it is at one instant, and the exports as they came."""

import ctypes
import errno
import hashlib
import json
import os
import shutil
import signal
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sqlalchemy.exc import DatabaseError

from app.errors import RequestError
from app.folders import sync_folder
from app.services.database_errors import DISK_FULL, away_in_words
from app.services.intake.uploads import STORED, stored_files
from app.services.upkeep.draft_folder import BEING_WRITTEN, PART, draft_of, settle
from app.services.upkeep.presence import alone
from app.services.upkeep.tables import migrate, refuse_missing, refuse_newer, refuse_unmounted
from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import Database, copying, health, schema
from app.storage.database import ProgramAddress, program_address
from app.storage.types import now

SQLITE, POSTGRESQL = "loopaudit.db", "loopaudit.dump"
MANIFEST, UPLOADS, MOVING = "manifest.json", "uploads", ".moving"
COPIED_PAGES = 2000
COPIED_BYTES = 1 << 20
SHOWN = 60
"""Characters of a manifest that is none."""
ANEW = 3
"""So many times its parts may be copied before nobody is let in between any more."""
UNUSABLE = (DatabaseError, sqlite3.Error)
"""What is raised of a file that is no database."""
LIBC = ctypes.CDLL(None)
PR_SET_PDEATHSIG = 1
"""Of Linux: which signal a process gets when the one that started it has ended."""
NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EACCES)


@dataclass(frozen=True)
class BackupReport:
    """`schema` is the version of the tables; `removed` what backups that were killed had left beside it."""

    folder: Path
    schema: str
    files: int
    bytes: int
    removed: tuple[Path, ...] = ()


def backup(settings: Settings, folder: Path) -> BackupReport:
    """Writes a backup into `folder`, which must not be there yet; it appears whole or not at all. What backups
    that were killed left in the folder around it is removed; what a living one writes there is not.

    The service may go on meanwhile. The database comes first: an export is stored before the database knows of it, so
    every export that the copy knows is there to be copied.
    """
    refuse_missing(settings)
    refusal = RequestError("backup_there", f"{folder} is there already; a backup is written into a new folder")
    if folder.exists():
        raise refusal
    made = [parent for parent in folder.parents if not parent.exists()]
    folder.parent.mkdir(parents=True, exist_ok=True)
    with draft_of(folder) as draft:
        told, size = _filled(settings, draft.folder)
        if folder.exists():
            raise refusal  # another backup into it was done first
        settle(draft, folder)
        for changed in (folder.parent, *(parent.parent for parent in made)):
            _sync_names(changed)
    return BackupReport(folder, told["schema"], len(told["files"]), size, draft.left)


def _filled(settings: Settings, draft: Path) -> tuple[dict[str, Any], int]:
    """Its manifest, and the bytes of what the manifest tells of."""
    with away_in_words(*UNUSABLE):
        kind, revision = _copy_database(settings, draft)
    _copy_uploads(settings, draft / UPLOADS)
    files = {path.relative_to(draft).as_posix(): _digest(path) for path in _files(draft)}
    told = {"database": kind, "schema": revision, "made_at": now().isoformat(), "files": files}
    told["loopaudit"] = version("loopaudit")
    size = sum(path.stat().st_size for path in _files(draft))
    _write(draft / MANIFEST, json.dumps(told, indent=1, sort_keys=True))
    _sync_names(draft)
    return told, size


def restore(settings: Settings, folder: Path, *, force: bool = False) -> BackupReport:
    """Brings a backup back, then to this version's tables.

    One of SQLite goes into PostgreSQL too. Raises RequestError where the service is running, where a file is missing,
    changed or not of the backup, where it is of PostgreSQL and goes into SQLite, where it is of a newer version, where
    PostgreSQL has tables of a newer version, or, unless `force`, where there are loops, uploads or keys already, and
    where an SQLite database would be made below a mount that is away.
    """
    told = _checked_manifest(folder)
    refuse_unmounted(settings)
    with away_in_words(*UNUSABLE), alone(settings):
        return _restored(settings, folder, told, force)


def _restored(settings: Settings, folder: Path, told: dict[str, Any], force: bool) -> BackupReport:
    database = Database(settings.resolved_database_url)
    try:
        url, is_sqlite = database.url, database.is_sqlite
        if is_sqlite and told["database"] != SQLITE:
            text = f"the backup holds {told['database']}, which SQLite cannot take: set LOOPAUDIT_DATABASE_URL"
            raise RequestError("backup_kind", text)
        if not schema.is_known(told["schema"]):
            text = f"the backup has tables of version {told['schema']}, which is newer than {schema.newest_revision()}"
            raise RequestError("backup_newer", f"{text}; restore it with the version of loopaudit that made it")
        if not force and _in_use(database):
            raise RequestError("not_empty", "the database is not empty; --force replaces what is in it")
        settings.prepare_folders()
        if not is_sqlite and told["database"] == POSTGRESQL:
            # What is restored replaces tables of its own version only: newer ones would stay, and hold on to it.
            refuse_newer(schema.current_revision(database))
            schema.bring_to(database, told["schema"])
    finally:
        database.close()
    # Exports first: where there is no room for all of them the database stays as it was, with all that it tells of.
    _drop_left(settings.uploads_dir)
    for file in _files(folder / UPLOADS):
        _put(file, settings.uploads_dir / file.name)
    sync_folder(settings.uploads_dir)
    if is_sqlite:
        _put_sqlite(folder / SQLITE, file_of(url))
    elif told["database"] == SQLITE:
        _move_in(settings, folder / SQLITE)
    else:
        _run(
            ["pg_restore", "--clean", "--if-exists", "--no-owner", "--single-transaction", "--exit-on-error"],
            program_address(url),
            folder / POSTGRESQL,
        )
    return BackupReport(
        folder, migrate(settings), len(told["files"]), sum(path.stat().st_size for path in _files(folder))
    )


def _drop_left(exports: Path) -> None:
    """Copies that a restore which was killed left half done; nobody else is at work."""
    for file in exports.glob(f".*{PART}"):
        copy_of = file.name.removeprefix(".").removesuffix(PART)
        if STORED.fullmatch(copy_of) and file.is_file() and not file.is_symlink():
            file.unlink(missing_ok=True)


def _move_in(settings: Settings, file: Path) -> None:
    """What the embedded default kept, into PostgreSQL: in one transaction, from a copy with this version's tables."""
    migrate(settings)
    place = settings.data_dir / MOVING
    shutil.rmtree(place, ignore_errors=True)  # of a restore that was killed
    place.mkdir(mode=0o700)
    _put_sqlite(file, place / SQLITE)
    source, target = Database(f"sqlite:///{place / SQLITE}"), Database(settings.resolved_database_url)
    try:
        schema.migrate(source)
        with source.read() as there, target.write() as here:
            copying.empty(here)
            copying.copy_rows(there, here)
    finally:
        source.close()
        target.close()
        shutil.rmtree(place, ignore_errors=True)


def _copy_database(settings: Settings, draft: Path) -> tuple[str, str]:
    database = Database(settings.resolved_database_url)
    try:
        revision = schema.current_revision(database)
        if revision is None:
            raise RequestError("no_tables", "the database has no tables; there is nothing to keep")
        if database.is_sqlite:
            with _written(draft / SQLITE) as target:
                _copy_sqlite(file_of(database.url), target)
            return SQLITE, revision
        _run(
            ["pg_dump", "--format=custom", "--no-owner", f"--file={draft / POSTGRESQL}"], program_address(database.url)
        )
        return POSTGRESQL, revision
    finally:
        database.close()


@contextmanager
def _written(target: Path) -> Iterator[Path]:
    """A full disk is told by what is written on it: SQLite names no file, and a copy the one that is read. So is what
    takes no more for another reason, such as a limit to the length of a file."""
    try:
        yield target
    except (OSError, sqlite3.Error) as error:
        if getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_IOERR_WRITE:
            raise OSError(errno.EIO, "cannot be written any further", str(target)) from error
        if (
            getattr(error, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
            or getattr(error, "errno", None) in DISK_FULL
        ):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(target)) from error
        raise


def _copy_sqlite(source: Path, target: Path) -> None:
    """SQLite's own online backup: one instant, while others read and write.

    It begins anew at each commit of theirs, unless it holds on to that instant; and where there is no write-ahead log,
    nobody can commit while it does. So there others write between its parts, as long as they leave it the time.
    """
    address = f"file:{source}?mode=ro"
    with (
        closing(sqlite3.connect(address, uri=True, timeout=30, isolation_level=None)) as there,
        closing(sqlite3.connect(target)) as here,
    ):
        has_log = there.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
        if not has_log and _copied_in_parts(there, here):
            return
        there.execute("BEGIN")
        there.execute("SELECT count(*) FROM sqlite_master").fetchone()
        there.backup(here, pages=COPIED_PAGES)


def _copied_in_parts(there: sqlite3.Connection, here: sqlite3.Connection) -> bool:
    """False where it would go on beginning anew."""
    parts = 0

    def counted(_: int, __: int, pages: int) -> None:
        nonlocal parts
        parts += 1
        if parts > ANEW * (pages // COPIED_PAGES + 1):
            raise _BegunAnewError

    try:
        there.backup(here, pages=COPIED_PAGES, progress=counted)
    except _BegunAnewError:
        return False
    return True


class _BegunAnewError(Exception):
    """Others wrote again and again."""


def _put_sqlite(source: Path, target: Path) -> None:
    check = sqlite3.connect(f"file:{source}?mode=ro", uri=True)
    found = check.execute("PRAGMA quick_check").fetchone()[0]
    check.close()
    if found != "ok":
        raise RequestError("backup_broken", f"the database in the backup is damaged: {found}")
    draft = _drafted(source, target)
    draft.chmod(0o600)
    _settle(target)
    for rest in ("-wal", "-shm", "-journal"):
        Path(f"{target}{rest}").unlink(missing_ok=True)
    sync_folder(target.parent)  # a journal that came back with the power would be played into the new file
    draft.replace(target)
    sync_folder(target.parent)


def _settle(file: Path) -> None:
    """What a process that was killed left in the journal goes into the old database, which so stays whole should the
    restore break off. One that is damaged is replaced as it is."""
    if not file.is_file():
        return
    with suppress(sqlite3.Error), closing(sqlite3.connect(file)) as old:
        old.execute("SELECT count(*) FROM sqlite_master").fetchone()  # which plays back what was amid a transaction
        old.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _copy_uploads(settings: Settings, target: Path) -> None:
    target.mkdir(mode=0o700)
    for file in stored_files(settings):
        try:
            _put(file, target / file.name)
        except FileNotFoundError:
            continue  # retention took it away in the meantime
    _sync_names(target)


def _put(source: Path, target: Path) -> None:
    """A copy that is there whole or not at all; its name is on disk when its folder is synced."""
    _drafted(source, target).replace(target)


def _drafted(source: Path, target: Path) -> Path:
    draft = target.with_name(f".{target.name}{PART}")
    draft.unlink(missing_ok=True)  # of one that was killed, or a link: what it leads to would be overwritten
    try:
        # "x" follows no link that was made since.
        with _written(draft), source.open("rb") as there, draft.open("xb") as here:
            shutil.copyfileobj(there, here, COPIED_BYTES)
    except BaseException:
        draft.unlink(missing_ok=True)  # else a disk that is full stays so
        raise
    with draft.open("rb") as file:
        os.fsync(file.fileno())
    return draft


def _sync_names(folder: Path) -> None:
    """Where a backup lies may be a share that syncs no folders, or a folder that cannot be listed."""
    try:
        sync_folder(folder)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise


def _write(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _files(folder: Path) -> Iterator[Path]:
    """Without what tells of the others, and without a lock that a backup that was killed at its end left behind."""
    apart = (folder / MANIFEST, folder / BEING_WRITTEN)
    return (path for path in sorted(folder.rglob("*")) if path.is_file() and path not in apart)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _checked_manifest(folder: Path) -> dict[str, Any]:
    try:
        text = (folder / MANIFEST).read_text(encoding="utf-8")
        told: dict[str, Any] = json.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise RequestError("no_backup", f"{folder} holds no backup: {MANIFEST} cannot be read") from error
    if not _of_a_backup(told):
        needed = f"{MANIFEST} needs database, schema and files as `loopaudit backup` writes them"
        raise RequestError("no_backup", f"{folder} holds no backup: {needed}, and is {text[:SHOWN]!r}")
    wrong = [name for name, digest in told["files"].items() if not _same(folder / name, digest)]
    if wrong:
        raise RequestError("backup_broken", f"missing or changed since the backup was made: {', '.join(wrong[:5])}")
    added = sorted({path.relative_to(folder).as_posix() for path in _files(folder)} - told["files"].keys())
    if added:
        raise RequestError("backup_broken", f"not of this backup, take it away: {', '.join(added[:5])}")
    return told


def _of_a_backup(told: Any) -> bool:
    """Others write a manifest.json too. A kind of database that is not known here is that of a newer backup."""
    if not isinstance(told, dict) or not isinstance(files := told.get("files"), dict):
        return False
    kind, revision = told.get("database"), told.get("schema")
    return isinstance(kind, str) and kind in files and isinstance(revision, str)


def _same(path: Path, digest: str) -> bool:
    return path.is_file() and _digest(path) == digest


def _in_use(database: Database) -> bool:
    if schema.current_revision(database) is None:
        return False
    with database.read() as connection:
        return health.in_use(connection)


def _run(command: list[str], address: ProgramAddress, *extra: Path) -> None:
    """A program of PostgreSQL; the password goes by its environment."""
    program = shutil.which(command[0])
    if program is None:
        raise RequestError("no_program", f"{command[0]} is not installed; it comes with PostgreSQL's client programs")
    environment = os.environ if address.password is None else {**os.environ, "PGPASSWORD": address.password}
    name = f"--dbname={address.url}"
    done = subprocess.run(  # noqa: S603 - a program of PostgreSQL with arguments of ours
        [program, *command[1:], name, *map(str, extra)],
        env=environment,
        capture_output=True,
        text=True,
        preexec_fn=_end_with_parent,
    )
    if done.returncode != 0:
        raise RequestError("backup_failed", f"{command[0]} ended with {done.returncode}: {done.stderr.strip()[-400:]}")


def _end_with_parent() -> None:
    """In a process before it becomes a program. Left alone by one that was killed, pg_restore would go on, and replace
    what a service that was started meanwhile has taken."""
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
