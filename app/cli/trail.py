"""`loopaudit trail`: who did what."""

import json
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.messages import ExitCode, console_for, say
from app.cli.opening import opened
from app.services.access.identity import OF_ACTION, OF_WHO

if TYPE_CHECKING:
    from app.services.moments import PlantClock
    from app.services.outward import TrailRowOut


def trail(
    limit: Annotated[int, typer.Option("--limit", min=1, max=100_000, help="Rows, the newest first.")] = 50,
    who: Annotated[str | None, typer.Option("--who", help=OF_WHO)] = None,
    action: Annotated[str | None, typer.Option("--action", help=OF_ACTION)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
) -> None:
    """Show who did what: uploads, audits, changes, keys, logins, and what was refused.

    Times are those of LOOPAUDIT_TIME_ZONE, as on the pages; with --json they are UTC.

    [bold]Examples[/bold]

      loopaudit trail --who historian

      loopaudit trail --action session.open --json
    """
    from app.services.access.trail import list_trail

    with opened() as backend:
        rows, clock = list_trail(backend, limit, who=who, action=action).rows, backend.clock
    if not rows and (who or action):
        say("loopaudit: nothing in the trail matches; --who and --action take whole names, as the trail shows them")
    if as_json:
        for row in rows:
            typer.echo(json.dumps(vars(row)))
    else:
        show(rows, clock)
    raise typer.Exit(ExitCode.DONE)


def show(rows: "list[TrailRowOut]", clock: "PlantClock") -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(f"When, {clock.name}", "Who", "Action", "Subject", "Outcome", "Request")
    for row in rows:
        outcome = row.outcome.replace("_", " ")
        cells = (clock.to_the_second(row.at), row.who, row.action, row.subject, outcome, row.request_id or "")
        table.add_row(*(Text(cell) for cell in cells))
    console_for(sys.stdout).print(table)
