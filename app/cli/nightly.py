"""`loopaudit nightly`: the whole plant, once, now."""

import json
import os
import socket
import sys
import time
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, progress, say
from app.cli.opening import opened
from app.counting import counted
from app.errors import RequestError

if TYPE_CHECKING:
    from app.services.backend import Backend
    from app.services.outward import AuditOut

LOOK_S = 0.5
OTHER = "another process of this account"


def nightly(
    wait: Annotated[bool, typer.Option("--wait/--no-wait", help="Wait for the end, or only start the audit.")] = True,
    timeout_s: Annotated[float, typer.Option("--timeout", min=1, help="Seconds to wait.")] = 6 * 3600.0,
) -> None:
    """Audit the whole plant once, now.

    It is the night of today's date, also before LOOPAUDIT_NIGHTLY_AT: the schedule then begins none on that date. A
    night that is under way is waited for; once it has ended, this makes one more run beside it.

    Where `serve` (without LOOPAUDIT_BROKER_URL) or `beat` runs, no cron is needed: they start the night at
    LOOPAUDIT_NIGHTLY_AT. Cron is for where neither runs.

    The run and how it ended are printed as JSON. Exit code 1: some loops failed; 2: there are no loops, the service is
    not ready, or the run has not ended after --timeout (it goes on). On the embedded default this command does the work
    together with the worker of `serve`, or alone where none runs.

    It works on the installation itself (LOOPAUDIT_DATA_DIR, LOOPAUDIT_DATABASE_URL), as `digest`, `report` and `keys`
    do, and has no --url: the night is one of the plant's, with digest and explanations. A service on another machine is
    asked by POST /v1/audits, or on its page of runs, for an audit of the whole plant that is no night.

    [bold]Examples[/bold]

      loopaudit nightly

      LOOPAUDIT_DATA_DIR=/srv/loopaudit loopaudit nightly --no-wait
    """
    from dataclasses import asdict

    from app.services.access.identity import COMMAND_LINE
    from app.services.access.trail import record
    from app.services.auditing.audits import start_audit
    from app.services.auditing.nightly import nightly as start
    from app.services.auditing.nightly import refuse_empty
    from app.services.upkeep.presence import at_work

    settings = load_settings(unattended=True)
    with opened(settings, migrates=settings.embedded) as backend, at_work(settings):
        refuse_unready(backend)
        refuse_empty(backend)
        run = start(backend, started_by=COMMAND_LINE.who)
        if run.ended:  # this night's run is done; whoever asks again wants another one
            run = start_audit(backend, trigger="nightly", started_by=COMMAND_LINE.who)
        record(backend, COMMAND_LINE, "audit.start", f"/v1/audits/{run.id}", "done")
        if wait:
            run = watched(backend, run, timeout_s)
    sys.stdout.write(json.dumps(asdict(run)) + "\n")
    raise typer.Exit(ExitCode.SOME_FAILED if run.failed else ExitCode.DONE)


def refuse_unready(backend: "Backend") -> None:
    from app.services.upkeep.readiness import lacking, readiness

    found = readiness(backend)
    if found.state == "not_ready":
        raise RequestError("not_ready", f"nothing was started: {'; '.join(lacking(found))}")


def watched(backend: "Backend", run: "AuditOut", timeout_s: float) -> "AuditOut":
    """Shows the run's progress until it ends, and lends a hand where this process may be the only one to work. A
    database that is away is waited for too: the run goes on once it is back."""
    from app.services.auditing.audits import get_audit
    from app.services.patience import patiently

    deadline = time.monotonic() + timeout_s
    if backend.settings.embedded:
        _warm_up(run, deadline, timeout_s)
    with progress("auditing", run.total) as advance:
        while not run.ended:
            if time.monotonic() > deadline:
                raise _timeout(run, timeout_s, "is a worker running?")
            before = run.done + run.failed
            lend_a_hand(backend, run.id)
            run = patiently(partial(get_audit, backend, run.id), deadline - time.monotonic())
            advance(run.done + run.failed - before)
    say(f"loopaudit: {counted(run.total, 'loop')}, {run.done:,} with a verdict, {run.failed:,} failed")
    return run


def _warm_up(run: "AuditOut", deadline: float, timeout_s: float) -> None:
    from app.kernel_cache import StillCompiling
    from app.services.auditing.warming import warm_up

    try:
        warm_up(deadline, lambda: say(f"loopaudit: waiting for {OTHER}, which compiles or loads the engine"))
    except StillCompiling as still:
        raise _timeout(run, timeout_s, f"{OTHER} still compiles or loads the engine") from still


def _timeout(run: "AuditOut", timeout_s: float, why: str) -> RequestError:
    return RequestError("timeout", f"the run {run.id} has not ended after {timeout_s:.0f} s; {why}")


def lend_a_hand(backend: "Backend", audit_id: str) -> None:
    """One chunk of loops on the embedded default; elsewhere workers do it."""
    if not backend.settings.embedded:
        time.sleep(LOOK_S)
        return
    from app.services.auditing.chunks import audit_chunk

    owner = f"nightly:{socket.gethostname()}:{os.getpid()}"
    if not audit_chunk(backend, int(audit_id), owner, calls_successor=False):
        time.sleep(LOOK_S)
