"""Whether the data folder takes what is written: it may be a share that is away, or a disk that the system made
read-only after an error. Both come back, and neither is a fault of the program."""

import os
import shutil
from typing import Literal

from app.settings import Settings

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
