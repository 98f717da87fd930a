"""`loopaudit digest`: what a night came to, printed or sent."""

import json
import os
import socket
import sys
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say
from app.cli.opening import opened
from app.counting import counted
from app.errors import RequestError

if TYPE_CHECKING:
    from app.services.backend import Backend
    from app.services.digests.deliveries import DeliveryView
    from app.services.moments import PlantClock


class Form(StrEnum):
    text = "text"
    html = "html"
    json = "json"


def digest(
    audit: Annotated[
        str | None,
        typer.Option(
            "--audit",
            help="The run; without it the newest nightly run or, if no night began in the 24 hours before the newest "
            "run of the whole plant, that run.",
        ),
    ] = None,
    send: Annotated[
        bool | None,
        typer.Option(
            "--send/--dry-run", help="Send it to the receivers of the settings, or only print it, as without either."
        ),
    ] = None,
    again: Annotated[
        bool,
        typer.Option("--again", help="Send it, also to those who have it, to try a receiver out; not with --dry-run."),
    ] = False,
    form: Annotated[Form, typer.Option("--format", help="What is printed.")] = Form.text,
) -> None:
    """Print the digest of a night: the five worst loops of each unit, and what changed; or send it now.

    After each nightly audit it goes to LOOPAUDIT_DIGEST_MAIL_TO and LOOPAUDIT_DIGEST_WEBHOOKS by itself. --send takes
    up what was given up; nobody gets the digest of a run twice without --again. Exit code 1: some receiver did not
    take it.

    [bold]Examples[/bold]

      loopaudit digest

      loopaudit digest --audit 17 --send

      loopaudit digest --send --again
    """
    from app.services.digests.making import digest_of, run_to_tell
    from app.services.digests.telling import as_html, as_json, as_text

    load_settings(unattended=True)
    if again and send is False:
        raise RequestError("dry_run_sends", "--again sends the digest, and --dry-run only prints it: give one of them")
    with opened() as backend:
        run = audit or run_to_tell(backend)
        if send or again:
            raise typer.Exit(sent(backend, run, again=again))
        found = digest_of(backend, run)
    if form is Form.json:
        sys.stdout.write(json.dumps(as_json(found), ensure_ascii=False) + "\n")
    else:
        sys.stdout.write(as_text(found) if form is Form.text else as_html(found))
    raise typer.Exit(ExitCode.DONE)


def sent(backend: "Backend", run: str, *, again: bool = False) -> ExitCode:
    """Each receiver and what became of it, on stdout."""
    from app.services.access.identity import COMMAND_LINE
    from app.services.digests.deliveries import send_now

    if not backend.settings.digest_receivers:
        raise RequestError(
            "no_receiver", "nobody is to get it: set LOOPAUDIT_DIGEST_MAIL_TO or LOOPAUDIT_DIGEST_WEBHOOKS"
        )
    owner = f"digest:{socket.gethostname()}:{os.getpid()}"
    found = send_now(backend, owner, run, by=COMMAND_LINE, again=again)
    for one in found:
        sys.stdout.write(f"{one.receiver}: {outcome(one, backend.clock)}\n")
    undone = sum(one.state != "done" for one in found)
    say(f"loopaudit: the digest of run {run} is with {len(found) - undone:,} of {counted(len(found), 'receiver')}")
    return ExitCode.SOME_FAILED if undone else ExitCode.DONE


def outcome(one: "DeliveryView", clock: "PlantClock") -> str:
    if one.before:
        at = f" at {clock.told(one.ended_at)}" if one.ended_at else ""
        return f"already delivered{at}; --again sends it once more"
    later = " (is tried again later)" if one.state == "open" else ""
    return f"{one.state}{later}{f': {one.reason}' if one.reason else ''}"
