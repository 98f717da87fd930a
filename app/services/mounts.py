"""Whether something is to be mounted where a folder is, and is away, by the tables of mounts of this machine."""

import os
import re
from contextlib import suppress
from pathlib import Path

FSTAB = Path("/etc/fstab")
"""What is to be mounted on this machine: a line each, its second field the place."""

MOUNTED = Path("/proc/self/mounts")
"""What is mounted, in the same form."""


def place_away(file: Path) -> Path | None:
    """The `unmounted_place` in which a file that is not there may be; None of one that is there."""
    return None if file.is_file() else unmounted_place(file.parent)


def unmounted_place(folder: Path) -> Path | None:
    """The place in which the folder is, or that it is, where the system is to mount something there and has not; None
    where it has, or where nothing tells. Links are followed, as a mount follows them."""
    mounted, folder = _places(MOUNTED), Path(os.path.realpath(folder))
    # What is mounted is not looked at: a share whose server is away lets nobody go on.
    wanted = {Path(os.path.realpath(place)) for place in _places(FSTAB) - mounted}
    for place in (folder, *folder.parents):
        if place in mounted or os.path.ismount(place):
            return None
        if place in wanted:
            return place
    return None


def _places(table: Path) -> set[Path]:
    """Of a table of mounts; none where it cannot be read."""
    lines: list[str] = []
    with suppress(OSError):
        lines = table.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    fields = (line.split() for line in lines if not line.lstrip().startswith("#"))
    return {Path(_plain(field[1])) for field in fields if len(field) > 1 and field[1].startswith("/")}


def _plain(field: str) -> str:
    """Blanks of a place are written there in octal."""
    return re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), field)
