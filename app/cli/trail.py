"""`loopaudit trail`: who did what."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.keys import opened
from app.cli.messages import ExitCode, stdout_console

if TYPE_CHECKING:
    from app.services.results import TrailView


def trail(
    limit: Annotated[int, typer.Option("--limit", min=1, max=100_000, help="Rows, the newest first.")] = 50,
    who: Annotated[str | None, typer.Option("--who", help="Only what this key (by its name) did.")] = None,
    action: Annotated[str | None, typer.Option("--action", help="Only this action, such as upload.receive.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
) -> None:
    """Show who did what: uploads, audits, changes, keys, logins, and what was refused.

    [bold]Examples[/bold]

      loopaudit trail --who historian

      loopaudit trail --action session.open --json
    """
    from app.services.access.trail import list_trail

    with opened() as backend:
        rows = list_trail(backend, limit, who=who, action=action).rows
    if as_json:
        for row in rows:
            typer.echo(json.dumps(vars(row)))
    else:
        show(rows)
    raise typer.Exit(ExitCode.DONE)


def show(rows: "list[TrailView]") -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table("When, UTC", "Who", "Action", "Subject", "Outcome", "Request")
    for row in rows:
        cells = (row.at[:19].replace("T", " "), row.who, row.action, row.subject, row.outcome, row.request_id or "")
        table.add_row(*(Text(cell) for cell in cells))
    stdout_console().print(table)
