"""`loopaudit loops`: the plant's loops as a list for a spreadsheet, and back."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.cli.messages import ExitCode, say
from app.cli.upload import DEFAULT_URL
from app.errors import DataError

LISTED = 20


def loops(
    file: Annotated[
        Path | None,
        typer.Argument(
            help="CSV with the column tag (or loop) and those to set; without it the list is printed.", metavar="[CSV]"
        ),
    ] = None,
    url: Annotated[str, typer.Option("--url", envvar="LOOPAUDIT_URL", help="Address of the service.")] = DEFAULT_URL,
    key: Annotated[
        str | None, typer.Option("--key", envvar="LOOPAUDIT_KEY", help="API key, if it asks for one.")
    ] = None,
) -> None:
    """Print the loops of a running service as CSV, or set what such a list says: importance, unit, type, spans, ...

    Columns that are left out and cells that are empty leave things as they are. Loops that are not there yet and values
    that cannot be are named, and the others are set; exit code 1.

    [bold]Examples[/bold]

      loopaudit loops > loops.csv

      loopaudit loops loops.csv --url http://plant-server:8000 --key la_audit_...
    """
    from app.cli.client import ServiceClient

    with ServiceClient(url, key) as client:
        if file is None:
            sys.stdout.write(client.loop_list())
            raise typer.Exit(ExitCode.DONE)
        done = client.take_loop_list(_bytes_of(file))
    typer.echo(f"{file}\tchanged {done['changed']}\tunchanged {done['unchanged']}\trefused {len(done['refused'])}")
    if done["ignored"]:
        say(f"{file}: not of a loop here, and left out: {', '.join(done['ignored'])}")
    for refused in done["refused"][:LISTED]:
        say(f"{file}: {refused['loop']}: {refused['text']} [{refused['code']}]")
    if len(done["refused"]) > LISTED:
        say(f"{file}: and {len(done['refused']) - LISTED} more")
    raise typer.Exit(ExitCode.SOME_FAILED if done["refused"] else ExitCode.DONE)


def _bytes_of(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        raise DataError("no_such_file", f"{file} is not there") from None
    except OSError as error:
        raise DataError("file", f"{file} cannot be read: {error.strerror}") from error
