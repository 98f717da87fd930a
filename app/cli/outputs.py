"""Files that a command writes: whole or not at all, and never over what it reads."""

import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from app.errors import RequestError

STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")
OPEN_ALREADY = ("/dev/std", "/dev/fd/", "/proc/")
NEW_FILE_MODE = 0o666


@contextmanager
def written(out: Path | None, inputs: Iterable[Path] = (), part: Path | None = None) -> Iterator[IO[str]]:
    """A stream to write `out` with; stdout, which stays open, where there is none.

    What was in the file stays until all is written, and for good where something fails on the way; where the command
    is interrupted, what it wrote until then goes to `part`, if anything. Devices and pipes are written as they are.
    Raises RequestError as `refuse_outputs` does, before anything is written.
    """
    refuse_outputs([out, None if is_stream(out) else part], inputs)
    if out is None or os.path.abspath(out) in STDOUT:
        yield sys.stdout
    elif is_stream(out):
        with out.open("w", encoding="utf-8", newline="") as stream:
            yield stream
    else:
        with _replacing(Path(os.path.realpath(out)), part) as stream:
            yield stream


def part_of(out: Path | None) -> Path | None:
    """Where a part of `out` is kept, in the folder that it is in."""
    return None if out is None else Path(f"{os.path.realpath(out) if out.is_symlink() else out}.part")


def is_stream(out: Path | None) -> bool:
    """Whether what is written cannot be taken back: stdout, a pipe, a device."""
    return out is None or os.path.abspath(out).startswith(OPEN_ALREADY) or (out.exists() and not out.is_file())


def refuse_outputs(outputs: Iterable[Path | None], inputs: Iterable[Path] = ()) -> None:
    """Raises RequestError("output_is_input") where an output is a file that is read, ("outputs_same") where two are one
    file, ("file") where one cannot be there.
    """
    read, taken = list(inputs), list[Path]()
    for out in outputs:
        if out is None:
            continue
        if out.is_dir() or not out.parent.is_dir():
            why = "is a folder" if out.is_dir() else f"cannot be written: {out.parent} is not a folder"
            raise RequestError("file", f"{out} {why}; name a file in an existing folder")
        if is_stream(out):
            continue
        if any(_same(out, file) for file in read):
            raise RequestError("output_is_input", f"{out} is one of the files that are read; name another to write to")
        if any(_same(out, file) for file in taken):
            raise RequestError("outputs_same", f"{out} would be written twice; name a file for each")
        taken.append(out)


def _same(out: Path, file: Path) -> bool:
    """By what they are where both are there (links too), by where they would be otherwise."""
    if out.exists() and file.exists():
        return out.samefile(file)
    return os.path.realpath(out) == os.path.realpath(file)


@contextmanager
def _replacing(target: Path, part: Path | None) -> Iterator[IO[str]]:
    """Writes beside the target, with the rights that it has or would get, and takes its place when all is on disk; that
    of the part where it is interrupted."""
    try:
        number, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(target)) from error
    draft = Path(name)
    try:
        with open(number, "w", encoding="utf-8", newline="") as stream:
            draft.chmod(_mode(target))
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(target)
    except BaseException as error:
        if part is not None and isinstance(error, KeyboardInterrupt) and draft.stat().st_size:
            draft.replace(part)
        with suppress(FileNotFoundError):
            draft.unlink()
        raise


def _mode(target: Path) -> int:
    if target.exists():
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return NEW_FILE_MODE & ~mask
