"""`loopaudit upload`: sends export files to a running service."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.audit import FORMS, SHOWN_REJECTS, beside_shown, recording_files
from app.cli.mapping import MappingOption, mapping_bytes
from app.cli.messages import ExitCode, progress, say
from app.cli.stamps import DateOrder
from app.errors import RequestError

if TYPE_CHECKING:
    from app.cli.client import ServiceClient
    from app.client import Upload

DEFAULT_URL = "http://127.0.0.1:8000"
LONG_S = 10.0
START_S = 30.0
"""So long a service of this machine may take to start."""


@dataclass(frozen=True)
class Reading:
    """How the service is to read a file: the plant's tag mapping, the zone of stamps that name none, and what stands
    first in dates that do not tell."""

    mapping: bytes | None = None
    time_zone: str | None = None
    date_order: str | None = None


def upload(
    paths: Annotated[list[Path], typer.Argument(help=f"Files, or folders of exports: {FORMS}.")],
    url: Annotated[str, typer.Option("--url", envvar="LOOPAUDIT_URL", help="Address of the service.")] = DEFAULT_URL,
    key: Annotated[
        str | None, typer.Option("--key", envvar="LOOPAUDIT_KEY", help="API key, if it asks for one.")
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait until the files are read, and say what was in them.")
    ] = False,
    timeout_s: Annotated[float, typer.Option("--timeout", min=1, help="Seconds to wait for a file.")] = 600.0,
    mapping: MappingOption = None,
    time_zone: Annotated[
        str | None,
        typer.Option("--time-zone", help="Zone of time stamps that name none (IANA); without it, the service's."),
    ] = None,
    date_order: Annotated[
        DateOrder,
        typer.Option(
            "--date-order",
            help="What stands first in dates such as 03/04/2026, where the file leaves it open; auto: the service's.",
        ),
    ] = DateOrder.auto,
) -> None:
    """Send export files to a running service. The same file again changes nothing.

    Exit code 1: some files were refused, or (told by --wait) hold no loop, arrived damaged, or were not read within
    --timeout; 2: no file could be used, or none was read within --timeout.

    [bold]Examples[/bold]

      loopaudit upload export.csv --wait

      loopaudit upload exports/ --url http://plant-server:8000 --key la_upload_...

      loopaudit upload export.csv --mapping tags.csv --time-zone Europe/Berlin --wait
    """
    from app.cli.client import ServiceClient

    files = recording_files(paths)
    order = None if date_order is DateOrder.auto else date_order.value
    how = Reading(mapping_bytes(mapping), time_zone, order)
    refuse_absent(files)
    failures = empty = damaged = 0
    with ServiceClient(url, key) as client:
        await_start(client)
        for file in files:
            try:
                state = send(client, file, timeout_s if wait else None, how)
                report(file, state)
                empty += holds_no_loop(file, state)
                damaged += came_damaged(file, state)
            except RequestError as error:
                if error.code == "no_service":
                    raise
                failures += 1
                say(f"{file}: {error.message} [{error.code}]")
            except FileNotFoundError:
                failures += 1
                say_absent(file)
            except OSError as error:
                failures += 1
                say(f"{file}: cannot be read: {error.strerror} [file]")
    unusable = failures + empty
    if unusable == len(files):
        raise typer.Exit(ExitCode.NOTHING_USABLE)
    raise typer.Exit(ExitCode.SOME_FAILED if unusable or damaged else ExitCode.DONE)


def refuse_absent(files: list[Path]) -> None:
    """Where none of them is there, no service needs to be asked, or waited for."""
    if not all(map(is_absent, files)):
        return
    for file in files:
        say_absent(file)
    raise typer.Exit(ExitCode.NOTHING_USABLE)


def say_absent(file: Path) -> None:
    say(f"{file}: is not there [no_such_file]")


def is_absent(file: Path) -> bool:
    """Not where it merely cannot be looked at."""
    try:
        file.stat()
    except OSError as error:
        return isinstance(error, FileNotFoundError)
    return False


def await_start(client: "ServiceClient") -> None:
    """Where the service is to run on this machine and its port is closed, it may be about to start."""
    if client.local and client.refused():
        say(f"nothing answers at {client.url} yet; waiting up to {START_S:.0f} s for a service that starts")
        client.ready(START_S)


def send(client: "ServiceClient", file: Path, wait_s: float | None, how: Reading | None = None) -> Mapping[str, Any]:
    """Uploads one file and, if asked, waits until it is read; raises RequestError where it could not be used."""
    with progress(file.name, file.stat().st_size, bytes_=True) as advance:
        kept = client.upload(file, sent=advance, **vars(how or Reading()))
    if wait_s is not None:
        id_, seen = kept.id, why_it_waits(file)
        kept = client.until_ended(f"/v1/uploads/{id_}", lambda: client.get_upload(id_), seen, wait_s)
    if kept.state == "failed":
        code = "upload_failed" if kept.error_code is None else kept.error_code
        raise RequestError(code, kept.reason or "the file could not be used")
    return kept.raw


def why_it_waits(file: Path, clock: Callable[[], float] = time.monotonic) -> Callable[["Upload"], None]:
    """Says, each reason once, why an upload waits: for room, which is no worker that is missing, or, where nobody has
    begun to read it for long, for what a worker may have to do first."""
    said: set[str] = set()
    since_s = clock()

    def seen(upload: "Upload") -> None:
        if upload.waits_for_room_since:
            why = "waiting for room on the disk of the service, which keeps it and tries again"
        elif upload.waits_for_file_since:
            why = "kept by the service, and no worker sees its file: all need the same LOOPAUDIT_DATA_DIR"
        elif upload.state == "received" and clock() - since_s >= LONG_S:
            first = "at the first start of a version its worker compiles the engine, for a minute or two"
            why = f"kept by the service, and not read yet; {first}"
        else:
            return
        if why not in said:
            said.add(why)
            say(f"{file}: {why}")

    return seen


def report(file: Path, state: Mapping[str, Any]) -> None:
    """The result on stdout; what was odd and the rows that were refused on stderr, with their lines."""
    typer.echo(f"{file}\t{state['id']}\t{state['state']}\tloops {len(state.get('loops') or ())}")
    for note in state.get("notes") or ():
        say(f"{file}: {note}")
    shown = (state.get("rejects") or ())[:SHOWN_REJECTS]
    for reject in shown:
        where = "" if reject["line"] is None else f"line {reject['line']}: "
        say(f"{file}: {where}{reject['text']} [{reject['code']}]")
    for more in beside_shown(state.get("rows_refused") or 0, len(shown)):
        say(f"{file}: {more}")


def holds_no_loop(file: Path, state: Mapping[str, Any]) -> bool:
    """Whether it was read to its end without finding a loop; said on stderr."""
    nothing = state["state"] == "done" and not state.get("loops")
    if nothing:
        say(f"{file}: no loop was found in it; `loopaudit inspect` says which columns it has [no_loops]")
    return nothing


def came_damaged(file: Path, state: Mapping[str, Any]) -> bool:
    """Whether a part of it could not be read; said on stderr, after the note of what was lost."""
    lost = bool(state.get("damaged"))
    if lost:
        say(f"{file}: arrived damaged; what could be read is kept, send the whole file again [damaged]")
    return lost
