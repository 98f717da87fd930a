"""`loopaudit worker` and `loopaudit beat`: the processes behind the service."""

from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say
from app.cli.opening import opened
from app.cli.starting import ready_to_work
from app.errors import RequestError

if TYPE_CHECKING:
    from app.settings import Settings

UntilParentEnds = Annotated[bool, typer.Option("--until-parent-ends", hidden=True)]


def worker(
    concurrency: Annotated[int, typer.Option("--concurrency", min=1, help="Processes, one thread each.")] = 1,
    check: Annotated[bool, typer.Option("--check", help="Only say whether work goes on; for health checks.")] = False,
    until_parent_ends: UntilParentEnds = False,
) -> None:
    """Run a worker: it reads uploads and audits loops until it is told to stop (SIGTERM, Ctrl-C).

    Start as many processes as there are cores to spare. A worker on another machine needs the same database and
    broker, and the same folder LOOPAUDIT_DATA_DIR on a shared file system: it reads the exports there. One that does
    not see them audits all the same, but an upload stays `received` until a worker that sees its file takes it.

    [bold]Examples[/bold]

      loopaudit worker

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://... LOOPAUDIT_BROKER_URL=redis://... loopaudit worker --concurrency 2
    """
    from app.queue.running import run_worker

    settings = load_settings(warns=not until_parent_ends, unattended=True)
    if check:
        refuse_standstill(settings)
    else:
        with ready_to_work(settings, until_parent_ends):
            run_worker(settings, concurrency)
    raise typer.Exit(ExitCode.DONE)


def beat(until_parent_ends: UntilParentEnds = False) -> None:
    """Run the schedule: every few seconds it has a worker look for what was lost, and whether the night's audit is due.

    That worker decides by its own settings, LOOPAUDIT_NIGHTLY_AT and LOOPAUDIT_TIME_ZONE too: give all processes the
    same. One beat is enough; two do no harm.

    [bold]Examples[/bold]

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://... LOOPAUDIT_BROKER_URL=redis://... loopaudit beat
    """
    from app.queue.running import run_beat

    settings = load_settings(warns=not until_parent_ends, unattended=True)
    with ready_to_work(settings, until_parent_ends):
        run_beat(settings)
    raise typer.Exit(ExitCode.DONE)


def refuse_standstill(settings: "Settings") -> None:
    """A worker that hears nothing looks alive to everyone but the database: loops wait, and nobody gives a sign."""
    from app.services.auditing.standing_still import stands_still_s

    with opened(settings, migrates=False) as backend:
        silent_s = stands_still_s(backend)
    if silent_s:
        raise RequestError(
            "standstill", f"loops are waiting, and no worker has given a sign of life for {silent_s:.0f} s"
        )
    say("loopaudit: work goes on, or there is none")
