"""`loopaudit migrate`: brings the database to this version's tables."""

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say


def migrate() -> None:
    """Bring the database to this version's tables. `serve` does it by itself on the embedded default.

    [bold]Examples[/bold]

      LOOPAUDIT_DATABASE_URL=postgresql+psycopg://user@host/plant loopaudit migrate
    """
    from app.services.upkeep.tables import migrate as bring_up

    say(f"loopaudit: the database is at {bring_up(load_settings(unattended=True))}")
    raise typer.Exit(ExitCode.DONE)
