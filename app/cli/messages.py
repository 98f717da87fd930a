"""What the command line says beside its results: always on stderr, so that stdout stays a pipe."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import IntEnum
from typing import IO, TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from rich.console import Console

PIPE_WIDTH = 180


class ExitCode(IntEnum):
    """What scripts may rely on."""

    DONE = 0
    SOME_FAILED = 1
    NOTHING_USABLE = 2


class Advance(Protocol):
    """Moves a progress bar on."""

    def __call__(self, steps: float = 1, *, label: str | None = None) -> None: ...


FROM, WARNING = "loopaudit: ", "warning: "


class _Said:
    """`as_log`: what is said is a line of JSON, among those of the log."""

    as_log = False


def say_as_log() -> None:
    """From here on, in this process."""
    _Said.as_log = True


def say(text: str, level: str = "info") -> None:
    """One line on stderr, as it is: no mark-up, because file names and tags may hold brackets. Where nobody reads it,
    or the disk of a log is full, the results are made all the same.
    """
    write_line(_in_json(text.removeprefix(FROM).removeprefix(WARNING), level) if _Said.as_log else text)


def refuse(message: str, code: str) -> None:
    """Why the command ends, with its stable code."""
    write_line(_in_json(message, "error", code=code) if _Said.as_log else f"{FROM}{message} [{code}]")


def _in_json(text: str, level: str, **told: str) -> str:
    from app.logs import in_json

    return in_json(text, level, **told)


def write_line(text: str) -> None:
    """On stderr, as it is now; nothing where it cannot be written."""
    with suppress(OSError):
        sys.stderr.write(text + "\n")
        sys.stderr.flush()


def console_for(stream: IO[str]) -> "Console":
    """For tables: as wide as the terminal; wide enough for whole sentences where the output is a pipe or a file."""
    from rich.console import Console

    return Console(file=stream, width=None if stream.isatty() else PIPE_WIDTH, highlight=False)


@contextmanager
def progress(label: str, total: float | None, *, bytes_: bool = False) -> Iterator[Advance]:
    """A progress bar on stderr; silent where stderr is not a terminal, so that logs stay readable."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, DownloadColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    figures = DownloadColumn() if bytes_ else MofNCompleteColumn()
    columns = (TextColumn("{task.description}"), BarColumn(), figures, TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task(escape(label), total=total)

        def advance(steps: float = 1, *, label: str | None = None) -> None:
            bar.update(task, advance=steps, description=escape(label) if label is not None else None)

        yield advance
