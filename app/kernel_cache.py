"""Where compiled kernels are kept: one folder for each state of the source that they are compiled from.

numba looks only at the file of the function that it compiled: a kernel that calls a changed function in another file
or a package whose files all bear the same date, would go on running old machine code.
"""

import fcntl
import hashlib
import os
import re
import shutil
import time
from collections.abc import Callable, Container, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import IO

LOCK, LOOK_S = ".compiling", 0.2
_COMPILES = "compiles"
KEPT_S = 30 * 86400.0  # since a source was last started
ENGINE = Path(__file__).parent / "engine"
READERS = tuple(
    Path(__file__).parent / "ingest" / f"{name}.py"
    for name in ("tables/scan_kernel", "numbers/kind_kernel", "numbers/kind_codes")
)
IMPORTED = re.compile(r"^\s*(?:from|import) app\.engine([^\n(]*(?:\([^)]*\))?)", re.MULTILINE)


def choose() -> None:
    """Points numba to the folder for this source; a folder named before, or a closed home, leaves it as it is."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    folder = _own_folder()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        os.utime(folder)
    except OSError:
        return
    if os.access(folder, os.W_OK):
        os.environ["NUMBA_CACHE_DIR"] = str(folder)
        _forget_old(folder)


class NotCompiled(Exception):
    """A kernel is not in the cache."""


@contextmanager
def loading_only() -> Iterator[None]:
    """In here kernels are loaded from the cache; before one would be compiled, NotCompiled is raised."""
    from numba.core import event  # reads where its cache is as it is imported: `choose` comes first

    class Refusing(event.Listener):
        def on_start(self, event: object) -> None:
            raise NotCompiled

        def on_end(self, event: object) -> None: ...

    with event.install_listener("numba:compile", Refusing()):
        yield


@contextmanager
def told_of_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """In here `tell` is called once, before the first kernel that is not in the cache is compiled."""
    from numba.core import event  # as above

    class Telling(event.Listener):
        told = False

        def on_start(self, event: object) -> None:
            if not self.told:
                self.told = True
                tell()

        def on_end(self, event: object) -> None: ...

    with event.install_listener("numba:compile", Telling()):
        yield


class StillCompiling(Exception):
    """Another process compiles for this cache, and whoever waits for it has waited long enough."""


@contextmanager
def one_at_a_time(deadline_s: float | None = None, waits: Callable[[], None] | None = None) -> Iterator[None]:
    """Of several processes that compile for this cache at once, also those of other plants, one does while the others
    wait, and then load. Not to be nested. Where the cache cannot be written everybody compiles.

    deadline_s: by `time.monotonic`, until when to wait; then StillCompiling is raised. None: for ever. waits: called
    once where there is something to wait for.
    """
    with ExitStack() as held:
        if folder := os.environ.get("NUMBA_CACHE_DIR"):
            with suppress(OSError):
                Path(folder).mkdir(parents=True, exist_ok=True)
                lock = held.enter_context((Path(folder) / LOCK).open("a"))  # who waits leaves the mark
                if not _taken(lock) and waits is not None:
                    waits()
                _wait_for(lock, deadline_s)
                lock.truncate(0)
                held.enter_context(told_of_compiling(partial(_mark, lock)))
        yield


def _mark(lock: IO[str]) -> None:
    """For `compiling`: that it is no mere loading."""
    with suppress(OSError):
        lock.write(_COMPILES)
        lock.flush()


def _wait_for(lock: IO[str], deadline_s: float | None) -> None:
    if deadline_s is None:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return
    while not _taken(lock):
        if time.monotonic() > deadline_s:
            raise StillCompiling
        time.sleep(LOOK_S)


def _taken(lock: IO[str]) -> bool:
    """Whether it is ours by now."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def compiling() -> bool:
    """Whether some process compiles for this cache at the moment: one that loads what is there takes no minute."""
    folder = os.environ.get("NUMBA_CACHE_DIR")
    if not folder:
        return False
    try:
        with (Path(folder) / LOCK).open() as lock:
            marked = bool(lock.read())
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return marked
    except OSError:
        return False
    return False


def empty() -> None:
    """Drops all compiled kernels of the folder in use; of one that was named, which others may use too, none."""
    folder = _own_folder()
    if os.environ.get("NUMBA_CACHE_DIR") == str(folder):
        with one_at_a_time(), suppress(OSError):
            for path in folder.rglob("*.nb[ic]"):
                path.unlink(missing_ok=True)


def _forget_old(own: Path) -> None:
    """Drops the folders of sources that nobody has started for long. A process that runs has its kernels in memory."""
    for other in own.parent.iterdir():
        with suppress(OSError):  # another process may drop it at the same time
            if other != own and time.time() - other.stat().st_mtime > KEPT_S:
                shutil.rmtree(other)


def _own_folder() -> Path:
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    return root / "loopaudit" / "kernels" / _source_digest()


def _source_digest() -> str:
    digest = hashlib.blake2b(digest_size=8)
    for path, text in sorted(_compiled_from().items()):
        digest.update(path.relative_to(ENGINE).as_posix().encode())
        digest.update(text.encode())
    for path in READERS:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _compiled_from() -> dict[Path, str]:
    """The modules with kernels and what they import from the engine, because its constants end up in machine code."""
    texts = {path: path.read_text("utf-8") for path in ENGINE.rglob("*.py")}
    reached: dict[Path, str] = {}
    waiting = [path for path, text in texts.items() if "numba" in text]
    while waiting:
        path = waiting.pop()
        if path not in reached:
            reached[path] = texts[path]
            waiting += [found for line in set(IMPORTED.findall(texts[path])) for found in _modules(line, texts)]
    return reached


def _modules(imported: str, known: Container[Path]) -> list[Path]:
    """The known files behind an import line, given what follows app.engine: ".valve.he import x", " import sampled"."""
    package, _, names = imported.partition(" import ")
    base = ENGINE.joinpath(*package.strip().split("."))
    found = [_file(base / name.strip(" ()\n"), known) or _file(base, known) for name in names.split(",")]
    return [path for path in found if path]


def _file(module: Path, known: Container[Path]) -> Path | None:
    candidates = (module.with_suffix(".py"), module / "__init__.py")
    return next((path for path in candidates if path in known), None)
