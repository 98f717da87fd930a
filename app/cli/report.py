"""`loopaudit report`: what is known of a loop or of the plant, in one HTML file."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say
from app.cli.opening import opened
from app.cli.outputs import written
from app.errors import RequestError


def report(
    loop: Annotated[str | None, typer.Option("--loop", help="Tag of a loop.")] = None,
    plant: Annotated[bool, typer.Option("--plant", help="The whole plant.")] = False,
    out: Annotated[Path | None, typer.Option("--out", help="File to write; without it stdout.")] = None,
) -> None:
    """Write a report of a loop or of the plant: one HTML file that opens anywhere, without network, and prints.

    [bold]Examples[/bold]

      loopaudit report --loop FIC101 --out FIC101.html

      loopaudit report --plant --out plant.html
    """
    from app.services.reports.documents import loop_report, plant_report
    from app.services.upkeep.tables import database_files

    if (loop is None) == (not plant):
        raise RequestError("which_report", "say either --loop TAG or --plant")
    with written(out, database_files(load_settings())) as stream:
        with opened() as backend:
            html = plant_report(backend) if loop is None else loop_report(backend, loop)
        stream.write(html)
    if out is not None:
        say(f"loopaudit: {out} written, {len(html) // 1000} kB")
    raise typer.Exit(ExitCode.DONE)
