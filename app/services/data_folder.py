"""Whether the data folder takes what is written: it may be a share that is away, or a disk that the system made
read-only after an error. Both come back, and neither is a fault of the program."""

import logging
import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from sqlalchemy.exc import SQLAlchemyError

from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import Database, schema, uploads

log = logging.getLogger("loopaudit.upkeep")

FolderState = Literal["ok", "read-only", "gone"]


def folder_state(settings: Settings) -> FolderState:
    """Of the folder into which exports come; that of a share which was not mounted is not there either."""
    if os.access(settings.uploads_dir, os.W_OK | os.X_OK):
        return "ok"
    return "read-only" if os.access(settings.uploads_dir, os.F_OK) else "gone"


def folder_away(settings: Settings, error: Exception) -> bool:
    """Whether that is why a file could not be had or written."""
    return isinstance(error, OSError) and folder_state(settings) != "ok"


def free_bytes(settings: Settings) -> int:
    """On the disk of the data folder; none where it is gone."""
    try:
        return shutil.disk_usage(settings.data_dir).free
    except OSError:
        return 0


@dataclass
class NewFolder:
    """The data folder with its parts, made where it is new. Where the database knows of exports it is not new but
    away, as a share that is not mounted: what was taken in its place would be gone from sight with its return. So it is
    not made either where the database cannot be asked, until `make_once_told`. untold: whether it could not be."""

    settings: Settings
    database: Database
    untold: bool = False

    def make(self) -> None:
        if _is_there(self.settings.uploads_dir):
            return
        self.untold = True
        with suppress(SQLAlchemyError):  # which whoever needs the database tells
            if not _knows_exports(self.database):
                self.settings.prepare_folders()
            self.untold = False

    def make_once_told(self) -> None:
        """Again, where the database was away when it was asked. One that was there meanwhile, or at the start, is not
        new."""
        if _is_there(self.settings.uploads_dir):
            self.untold = False
        elif self.untold:
            self.make()


def _is_there(folder: Path) -> bool:
    with suppress(OSError):  # of a share whose server is away
        return folder.is_dir()
    return False


def tell_if_away(settings: Settings) -> None:
    """For a process that stays."""
    state = folder_state(settings)
    if state == "gone":
        log.error("%s is not there and is waited for: mount it; %s", settings.uploads_dir, if_lost(settings))
    elif state == "read-only":
        log.error("%s cannot be written to: exports are refused until it can", settings.uploads_dir)


def if_lost(settings: Settings) -> str:
    return f"only if it is lost for good, `mkdir -p -m 700 {settings.uploads_dir}` lets new exports in"


def _knows_exports(database: Database) -> bool:
    if database.is_sqlite and not file_of(database.url).is_file():
        return False  # looking would make it
    if schema.current_revision(database) is None:
        return False
    with database.read() as connection:
        return uploads.any_known(connection)
