"""`loopaudit serve`: API and pages, and on the embedded default worker and schedule beside them."""

import ipaddress
import signal
import socket
import sys
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say
from app.errors import RequestError

if TYPE_CHECKING:
    from app.settings import Settings

CHILDREN_GRACE_S = 15.0
CONNECTIONS_GRACE_S = 5


def serve(
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port to listen on; 0: any free one.")] = 8000,
    until_parent_ends: Annotated[bool, typer.Option("--until-parent-ends", hidden=True)] = False,
) -> None:
    """Serve API and pages; on the embedded default (SQLite, no broker server) worker and schedule run beside it.

    With LOOPAUDIT_DATABASE_URL and LOOPAUDIT_BROKER_URL set, only API and pages: start `loopaudit worker` and
    `loopaudit beat` for themselves. SIGTERM or Ctrl-C stops everything that was started.

    [bold]Examples[/bold]

      loopaudit serve

      LOOPAUDIT_DATA_DIR=/srv/loopaudit loopaudit serve --port 8080
    """
    settings = load_settings()
    refuse_open_access(host, settings)
    signal.signal(signal.SIGTERM, stop_quietly)
    if until_parent_ends:
        from app.cli.supervisor import stop_with_parent

        stop_with_parent()
    with listen(host, port) as listening:
        run(settings, listening)
    raise typer.Exit(ExitCode.DONE)


def refuse_open_access(host: str, settings: "Settings") -> None:
    """There are no keys yet: whoever reaches the port may do everything, so only this machine may reach it."""
    if is_loopback(host) or settings.allow_open:
        return
    raise RequestError(
        "open_access",
        f"will not listen on {host}: there are no keys yet, so anyone who reaches this port could read and change "
        "everything. Listen on 127.0.0.1 behind a proxy that asks who is there, or set LOOPAUDIT_ALLOW_OPEN=true where "
        "the network itself keeps others out",
    )


def is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def stop_quietly(signum: int, frame: FrameType | None) -> None:
    """SIGTERM outside of the server's own handling, as while starting up, still runs what has to be cleaned up."""
    sys.exit(ExitCode.DONE)


def listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
    except OSError as error:
        listening.close()
        raise RequestError(
            "cannot_listen", f"cannot listen on {host} port {port}: {error.strerror or error}"
        ) from error
    return listening


def run(settings: "Settings", listening: socket.socket) -> None:
    import uvicorn

    from app.cli.supervisor import Child, Supervisor
    from app.main import create_app
    from app.services.operations import migrate

    if settings.embedded:
        migrate(settings)
    app = create_app(settings)
    config = uvicorn.Config(app, log_level="warning", access_log=False, timeout_graceful_shutdown=CONNECTIONS_GRACE_S)
    names = ("worker", "beat") if settings.embedded else ()
    supervisor = Supervisor([Child(name, (name, "--until-parent-ends")) for name in names], CHILDREN_GRACE_S)
    host, port = listening.getsockname()[:2]
    supervisor.start()
    try:
        say(f"loopaudit: serving on http://{f'[{host}]' if ':' in host else host}:{port}" + beside(names))
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        supervisor.stop()
        say("loopaudit: stopped")


def beside(names: tuple[str, ...]) -> str:
    if names:
        return f", with {' and '.join(names)}"
    return "; start `loopaudit worker` and `loopaudit beat` for themselves"
