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


def say(text: str) -> None:
    """One line on stderr, as it is: no mark-up, because file names and tags may hold brackets. Where nobody reads it,
    or the disk of a log is full, the results are made all the same.
    """
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
