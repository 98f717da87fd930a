"""`loopaudit demo`: a plant whose truth is known, through the whole service, and its table beside the truth."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli import interrupts
from app.cli.messages import ExitCode, progress, say
from app.errors import RequestError
from app.services.addresses import tag_in_url

if TYPE_CHECKING:
    import socket

    from app.cli.client import ServiceClient
    from app.client import Audit
    from app.services.demo import DemoExport, DemoLoop

START_WITHIN_S = 180.0
ASKED_FOR_S = 1.0  # until it is seen whether it is still there
# A worker compiles the engine at its first start: a minute, and several on a machine that has other work.
READ_WITHIN_S = 900.0
AUDIT_WITHIN_S = 900.0
STOP_WITHIN_S = 30.0
NOT_KEPT = ("loopaudit: the demo's service is stopped and removed; `loopaudit demo --serve` keeps its pages up",)


def demo(
    serve: Annotated[
        bool | None,
        typer.Option("--serve/--no-serve", help="Keep the pages up afterwards. By default on a terminal only."),
    ] = None,
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the service; 0: any free one.")] = 0,
) -> None:
    """Audit a demo plant of 60 simulated loops on the embedded default and print its table beside the truth.

    Writes the plant's exports, starts the service, uploads them over HTTP, audits the plant, and shows where to look.
    Nothing is left behind.

    [bold]Examples[/bold]

      loopaudit demo

      loopaudit demo --no-serve > table.txt
    """
    from app.cli.demo_table import print_demo
    from app.cli.serve import listen
    from app.services.demo import plant, write_exports

    keep = sys.stdout.isatty() if serve is None else serve
    ends = interrupts.ended_in_order(signal.SIGTERM, signal.SIGHUP)  # a terminal that is closed too
    with (
        ends,
        listen("127.0.0.1", port, at_once=True) as listening,  # a port that is taken may be a real plant's
        tempfile.TemporaryDirectory(prefix="loopaudit-demo-") as folder,
    ):
        loops = plant()
        say(f"loopaudit: simulating {len(loops):,} loops and writing their historian exports")
        exports = write_exports(Path(folder) / "exports", loops)
        with running_service(Path(folder) / "data", listening) as client:
            rows = audited(client, exports, loops)
            print_demo(loops, rows, sys.stdout)
            for line in where_to_look(client.url, at_the_top(client)) if keep else NOT_KEPT:
                say(line)
            if keep:
                wait_for_interrupt()
    raise typer.Exit(ExitCode.DONE)


def at_the_top(client: "ServiceClient") -> str:
    """The loop with which the plant's page begins."""
    return next(client.reliability(sort="-priority")).loop


def where_to_look(url: str, worst: str) -> tuple[str, ...]:
    return (
        f"loopaudit: now open {url}/ in a browser: the plant, worst loop first",
        f"loopaudit: why the worst one is flagged: {url}/loops/{tag_in_url(worst)}",
        "loopaudit: Ctrl-C stops the service and removes the demo",
    )


@contextmanager
def running_service(data_dir: Path, listening: "socket.socket") -> Iterator["ServiceClient"]:
    """`loopaudit serve` on the embedded default as a child process, ready to be asked; stopped afterwards. listening:
    where it is asked; the child alone keeps it, so that nobody else ever answers there, such as a real plant's service.
    """
    from app.cli.client import ServiceClient
    from app.cli.serve import address_of

    address, its = address_of(listening), listening.fileno()
    command = [sys.executable, "-m", "app", "serve", "--socket-of-parent", str(its), "--until-parent-ends"]
    data_dir.mkdir(parents=True)
    log = data_dir / "service.log"
    with log.open("wb") as log_file:
        process = subprocess.Popen(  # noqa: S603 - our own command
            command,
            env=embedded_environment(data_dir),
            stdin=subprocess.PIPE,
            stdout=log_file,
            stderr=log_file,
            pass_fds=(its,),
        )
        try:
            listening.close()
            with ServiceClient(address) as client:
                if not comes_up(process, client):
                    tail = log.read_text(encoding="utf-8", errors="replace")[-2000:]
                    late = f" within {START_WITHIN_S:.0f} s" if process.poll() is None else ""
                    raise RequestError("not_ready", f"the service did not come up{late}:\n{tail}")
                yield client
        finally:
            stop(process)


def comes_up(process: "subprocess.Popen[bytes]", client: "ServiceClient") -> bool:
    """False where it ended, or is not ready in time."""
    until = time.monotonic() + START_WITHIN_S
    while process.poll() is None and time.monotonic() < until:
        if client.ready(ASKED_FOR_S):
            return True
    return False


def embedded_environment(data_dir: Path) -> dict[str, str]:
    """This environment without anything that would point the demo at a real installation."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
    return environment | {"LOOPAUDIT_DATA_DIR": str(data_dir)}


def stop(process: "subprocess.Popen[bytes]") -> None:
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdin is not None:
        process.stdin.close()


def audited(
    client: "ServiceClient", exports: tuple["DemoExport", ...], loops: tuple["DemoLoop", ...]
) -> list[Mapping[str, Any]]:
    """Uploads the exports, tells units and spans, audits the plant: the rows of the reliability table."""
    from app.cli.upload import send

    say("loopaudit: the service is up; its worker compiles the engine at the very first start (a minute or two)")
    for export in exports:
        state = send(client, export.path, READ_WITHIN_S)
        say(f"loopaudit: uploaded {export.path.name}: {len(state['loops']):,} loops")
    for loop in loops:
        client.change_loop(loop.tag, **loop.what_it_is)
    id_ = client.start_audit().id
    with progress("auditing", len(loops)) as advance:
        client.until_ended(f"/v1/audits/{id_}", lambda: client.get_audit(id_), Advanced(advance), AUDIT_WITHIN_S)
    return [row.raw for row in client.reliability()]


class Advanced:
    """Turns the state of a run into steps of a progress bar."""

    def __init__(self, advance: Any) -> None:
        self._advance = advance
        self._done = 0

    def __call__(self, run: "Audit") -> None:
        done = run.done + run.failed
        self._advance(done - self._done)
        self._done = done


def wait_for_interrupt() -> None:
    try:
        signal.pause()
    except KeyboardInterrupt:
        say("")
