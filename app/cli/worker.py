"""`loopaudit worker` and `loopaudit beat`: the processes behind the service."""

import os
import sys
from typing import Annotated

import typer

from app.cli.configuration import load_settings

THREAD_LIMITS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "POLARS_MAX_THREADS",
)

UntilParentEnds = Annotated[bool, typer.Option("--until-parent-ends", hidden=True)]


def worker(
    concurrency: Annotated[int, typer.Option("--concurrency", min=1, help="Processes, one thread each.")] = 1,
    until_parent_ends: UntilParentEnds = False,
) -> None:
    """Run a worker: it reads uploads and audits loops until it is told to stop (SIGTERM, Ctrl-C).

    Start as many as there are cores to spare, on any machine that reaches the data base and the broker.

    [bold]Examples[/bold]

      loopaudit worker

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://... LOOPAUDIT_BROKER_URL=redis://... loopaudit worker --concurrency 2
    """
    become("worker", "--concurrency", str(concurrency), until_parent_ends=until_parent_ends)


def beat(until_parent_ends: UntilParentEnds = False) -> None:
    """Run the schedule: the nightly audit at LOOPAUDIT_NIGHTLY_AT, and the sweeper that sends again what was lost.

    One is enough; two do no harm.
    """
    become("beat", until_parent_ends=until_parent_ends)


def become(*arguments: str, until_parent_ends: bool) -> None:
    """Replaces this process by the workers' own command: one thread each, the processes are what scales."""
    load_settings()  # a wrong setting is told here, in one line
    for name in THREAD_LIMITS:
        os.environ.setdefault(name, "1")
    flags = ("--until-parent-ends",) if until_parent_ends else ()
    command = [sys.executable, "-m", "workers", *arguments, *flags]
    os.execv(sys.executable, command)  # noqa: S606 - our own command
