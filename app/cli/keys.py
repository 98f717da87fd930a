"""`loopaudit keys`: who may talk to the service."""

import json
import sys
from datetime import timedelta
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.messages import ExitCode, console_for, say
from app.cli.opening import opened
from app.services.access.identity import Role

if TYPE_CHECKING:
    from app.services.access.keys import NewKey
    from app.services.moments import PlantClock

cli = typer.Typer(no_args_is_help=True, help="Keys of the service: create, list, revoke, rotate.")

SHORTEST_DAYS = 0.001
LONGEST_DAYS = 36_500
MOST_A_MINUTE = 1_000_000

KeyId = Annotated[str, typer.Argument(metavar="ID", help="The id of the key, as `keys list` shows it.")]


@cli.command("create")
def create(
    name: Annotated[str, typer.Argument(help="Whose key it is: a person or a system. The trail shows this name.")],
    role: Annotated[
        Role, typer.Option("--role", help="read; upload and audit may read too; admin may do everything.")
    ] = Role.read,
    days: Annotated[
        float,
        typer.Option("--days", min=SHORTEST_DAYS, max=LONGEST_DAYS, help="For how many days it is good."),
    ] = 365.0,
    per_minute: Annotated[
        int, typer.Option("--per-minute", min=1, max=MOST_A_MINUTE, help="Requests that it may make a minute.")
    ] = 1200,
) -> None:
    """Make a key. It is shown once, on stdout; only its hash is kept.

    [bold]Examples[/bold]

      loopaudit keys create "historian" --role upload

      LOOPAUDIT_KEY=$(loopaudit keys create me --role admin --days 30)
    """
    from app.services.access import keys

    with opened(new=True) as backend:
        made = keys.create_key(backend, name, role, lifetime=timedelta(days=days), requests_per_minute=per_minute)
        show(made, backend.clock)
    raise typer.Exit(ExitCode.DONE)


@cli.command("list")
def list_(as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False) -> None:
    """Show all keys, without their secrets. Times are those of LOOPAUDIT_TIME_ZONE, as on the pages; with --json they
    are UTC.

    [bold]Examples[/bold]

      loopaudit keys list
    """
    from rich.table import Table
    from rich.text import Text

    from app.services.access import keys

    with opened() as backend:
        found, clock = keys.list_keys(backend), backend.clock
    if as_json:
        for key in found:
            typer.echo(json.dumps(vars(key)))
        raise typer.Exit(ExitCode.DONE)
    table = Table("Id", "Name", "Role", "State", f"Created, {clock.name}", "Expires", "Last used", "A minute")
    for key in found:
        times = (clock.short(at) if at else "never" for at in (key.created_at, key.expires_at, key.last_used_at))
        cells = (key.id, key.name, key.role, key.state, *times)
        table.add_row(*(Text(cell) for cell in cells), str(key.requests_per_minute))
    console_for(sys.stdout).print(table)
    raise typer.Exit(ExitCode.DONE)


@cli.command("revoke")
def revoke(key_id: KeyId) -> None:
    """End a key now, and the logins made with it. A running service knows it LOOPAUDIT_KEY_RECHECK_S later.

    [bold]Examples[/bold]

      loopaudit keys revoke k3j2h1
    """
    from app.services.access import keys

    with opened() as backend:
        key = keys.revoke_key(backend, key_id)
    say(f"loopaudit: the key {key.id} of {key.name} is revoked")
    raise typer.Exit(ExitCode.DONE)


@cli.command("rotate")
def rotate(
    key_id: KeyId,
    overlap_h: Annotated[
        float,
        typer.Option("--overlap", min=0, max=24 * LONGEST_DAYS, help="Hours for which the old key goes on working."),
    ] = 24.0,
) -> None:
    """Make a key like an old one, which ends after an overlap, so that its users can change over.

    [bold]Examples[/bold]

      loopaudit keys rotate k3j2h1 --overlap 48
    """
    from app.services.access import keys

    with opened() as backend:
        show(keys.rotate_key(backend, key_id, timedelta(hours=overlap_h)), backend.clock)
    say(f"loopaudit: the key {key_id} ends in {overlap_h:g} h at the latest")
    raise typer.Exit(ExitCode.DONE)


def show(made: "NewKey", clock: "PlantClock") -> None:
    """The key alone on stdout, so that it can be piped to where it is kept."""
    until = clock.told(made.key.expires_at) if made.key.expires_at else "it is revoked"
    say(f"loopaudit: key {made.key.id} of {made.key.name}, role {made.key.role}, good until {until}. Shown this once:")
    typer.echo(made.text)
