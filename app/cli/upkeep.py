"""`loopaudit doctor`, `backup` and `restore`: upkeep of an installation."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, console_for, say
from app.counting import counted

if TYPE_CHECKING:
    from app.services.upkeep.doctor import Check

AsJson = Annotated[bool, typer.Option("--json", help="One JSON object a line.")]


def doctor(as_json: AsJson = False) -> None:
    """Look over this installation: each thing that was looked at, what was found, and what to do about it.

    Exit code 0: nothing is wrong (warnings may be there); 1: something is.

    [bold]Examples[/bold]

      loopaudit doctor

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://... LOOPAUDIT_BROKER_URL=redis://... loopaudit doctor --json
    """
    from app.services.upkeep.doctor import examine

    checks = examine(load_settings(warns=False))  # it has a row for what is no setting
    if as_json:
        for check in checks:
            typer.echo(json.dumps(vars(check)))
    else:
        show(checks)
    unwell = any(check.state == "problem" for check in checks)
    raise typer.Exit(ExitCode.SOME_FAILED if unwell else ExitCode.DONE)


def show(checks: "list[Check]") -> None:
    from rich.table import Table
    from rich.text import Text

    colours = {"ok": "green", "warning": "yellow", "problem": "bold red"}
    table = Table("Check", "State", "Found", "Advice")
    for check in checks:
        state = Text(check.state, style=colours[check.state])
        table.add_row(Text(check.name), state, Text(check.found), Text(check.advice))
    console_for(sys.stdout).print(table)


def backup(folder: Annotated[Path, typer.Argument(help="A new folder for the backup.")]) -> None:
    """Copy the database as it is now, and the exports, into a new folder. The service may go on meanwhile.

    SQLite by its online backup; PostgreSQL by pg_dump, which must be installed. What a backup that was killed left in
    the folder around the new one is removed.

    [bold]Examples[/bold]

      loopaudit backup /srv/backup/loopaudit-$(date +%F)
    """
    from app.services.upkeep.backup import backup as keep

    done = keep(load_settings(unattended=True), folder)
    for part in done.removed:
        say(f"loopaudit: removed {part}, which a backup that was killed had left")
    files = counted(done.files, "file")
    say(f"loopaudit: {done.folder} holds {files}, {done.bytes:,} bytes, tables of version {done.schema}")
    raise typer.Exit(ExitCode.DONE)


def restore(
    folder: Annotated[Path, typer.Argument(help="Folder of a backup.")],
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Bring a backup back. Stop the service first: while it runs here, this is refused.

    Tables of an older version are brought to this one's.

    Keys come back as they were: revoke again what was revoked since.

    A backup of the embedded default (SQLite) goes into PostgreSQL too, which is how an installation moves there.

    [bold]Examples[/bold]

      loopaudit restore /srv/backup/loopaudit-2026-11-21

      LOOPAUDIT_DATABASE_URL=postgresql://loopaudit@db/loopaudit loopaudit restore /srv/backup/loopaudit-sqlite
    """
    from app.services.upkeep.backup import restore as bring_back

    done = bring_back(load_settings(), folder, force=force)
    restored = f"{counted(done.files, 'file')}, {done.bytes:,} bytes"
    say(f"loopaudit: restored {restored}; the tables have version {done.schema}")
    raise typer.Exit(ExitCode.DONE)
