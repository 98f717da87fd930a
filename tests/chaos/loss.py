"""A power cut for the uploads: what was written or renamed without being synced is gone afterwards.

The shim notes writes, syncs and renames of the API in their order. After the API was killed, everything that no sync
covers is taken back: a file keeps the bytes of its last fsync, a name lasts only once its folder was synced after it.
That is the strictest file system that POSIX allows, and stricter than ext4 or XFS.
"""

import shutil
import struct
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

SHIM = Path(__file__).with_name("shim.c")


def compiled(folder: Path) -> Path | None:
    """The shim as a library; None where there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    library = folder / "shim.so"
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", library, SHIM, "-ldl", "-lm"], check=True, timeout=120)
    return library


@dataclass
class Clock:
    """A wall clock that processes share through a file, and how far it is off."""

    path: Path

    def __post_init__(self) -> None:
        self.path.write_bytes(struct.pack("d", 0.0))
        self.path.chmod(0o644)

    def jump(self, seconds: float) -> None:
        with self.path.open("r+b") as file:
            file.write(struct.pack("d", seconds))


@dataclass
class Disk:
    """What of the files below a folder would survive, as the journal tells it."""

    synced: dict[str, int] = field(default_factory=dict)
    named: set[str] = field(default_factory=set)
    touched: set[str] = field(default_factory=set)
    renames: list[tuple[str, str]] = field(default_factory=list)

    def follow(self, line: str) -> None:
        what, *fields = line.split("\t")
        if what == "W":
            self.touched.add(fields[0])
        elif what == "S":
            self.synced[fields[0]] = int(fields[1])
        elif what == "D":
            self._keep_names(fields[0])
        elif what == "U":
            self._forget(fields[0])
        elif what == "R":
            self._rename(fields[0], fields[1], was_there=fields[2] == "1")

    def _keep_names(self, folder: str) -> None:
        self.named |= {path for path in self.touched if str(Path(path).parent) == folder}
        self.renames = [(old, new) for old, new in self.renames if str(Path(new).parent) != folder]

    def _forget(self, path: str) -> None:
        self.touched.discard(path)
        self.named.discard(path)
        self.synced.pop(path, None)

    def _rename(self, old: str, new: str, was_there: bool) -> None:
        size = self.synced.pop(old, 0)
        had_name = old in self.named
        self._forget(old)
        if was_there:  # the same bytes under the name of their fingerprint: the older file is there if this one is not
            self.touched.add(new)
            self.named.add(new)
            self.synced[new] = size
            return
        self.touched.add(new)
        self.synced[new] = size
        self.renames.append((old, new))
        if had_name:
            self.named.add(old)

    def cut(self) -> int:
        """Takes back what was not synced; returns how many files lost something."""
        lost = 0
        for path in sorted(self.touched):
            file = Path(path)
            if not file.is_file():
                continue
            kept = self.synced.get(path, 0)
            if path not in self.named:
                file.unlink()
                lost += 1
            elif file.stat().st_size > kept:
                with file.open("r+b") as shortened:
                    shortened.truncate(kept)
                lost += 1
        return lost


def power_cut(journal: Path) -> int:
    """Undoes what the journal's process did not sync, and begins a new journal. The process must have ended."""
    disk = Disk()
    if journal.is_file():
        for line in journal.read_text(encoding="utf-8", errors="replace").splitlines():
            disk.follow(line)
        journal.unlink()
    return disk.cut()
