"""`loopaudit serve`: API and pages, and on the embedded default worker and schedule beside them."""

import resource
import signal
import socket
import sys
from contextlib import AbstractContextManager, nullcontext, suppress
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.configuration import load_settings
from app.cli.messages import ExitCode, say
from app.cli.opening import tell_missing
from app.cli.starting import ready_to_work
from app.errors import RequestError

if TYPE_CHECKING:
    import uvicorn
    from fastapi import FastAPI

    from app.settings import Settings

CHILDREN_GRACE_S = 15.0
CONNECTIONS_GRACE_S = 5
LARGEST_CROWD = 2000  # connections; the limits of requests hold long before
OTHER_FILES = 500
"""Of the database, of uploads and of what is looked at: connections leave room for them."""
LARGEST_BURST = 100
"""Connections that are accepted before any of them is counted; all of one burst fit into what is left."""


def serve(
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port to listen on; 0: any free one.")] = 8000,
    until_parent_ends: Annotated[bool, typer.Option("--until-parent-ends", hidden=True)] = False,
    socket_of_parent: Annotated[int | None, typer.Option("--socket-of-parent", hidden=True)] = None,
) -> None:
    """Serve API and pages; on the embedded default (SQLite, no broker server) worker and schedule run beside it.

    With LOOPAUDIT_BROKER_URL set, only API and pages: start `loopaudit worker` and `loopaudit beat` for themselves.
    Otherwise it starts one worker of one process. SIGTERM or Ctrl-C stops everything that was started. On the embedded
    default a data folder has one server: a second one is refused, and further `loopaudit worker` may run beside it.

    [bold]Examples[/bold]

      loopaudit serve

      LOOPAUDIT_DATA_DIR=/srv/loopaudit loopaudit serve --port 8080
    """
    settings = load_settings(unattended=True)
    keys_required = asks_for_keys(host, settings)
    warn_of_openness(host, keys_required)
    signal.signal(signal.SIGTERM, stop_quietly)
    if settings.embedded:
        tell_missing(settings)
    with (
        listen(host, port) if socket_of_parent is None else socket.socket(fileno=socket_of_parent) as listening,
        only_one(settings, listening),
        ready_to_work(settings, until_parent_ends, migrates=settings.embedded),
    ):
        run(settings, listening, keys_required)
    raise typer.Exit(ExitCode.DONE)


def asks_for_keys(host: str, settings: "Settings") -> bool:
    """On loopback only where the settings say so; on any other address unless the settings open it on purpose."""
    from app.http.origins import is_loopback

    return settings.require_keys or not (is_loopback(host) or settings.allow_open)


def warn_of_openness(host: str, keys_required: bool) -> None:
    from app.http.origins import is_loopback

    if not (keys_required or is_loopback(host)):
        text = f"no key is asked for on {host} (LOOPAUDIT_ALLOW_OPEN): who reaches it may read and change everything"
        say(f"loopaudit: warning: {text}", "warning")


def only_one(settings: "Settings", listening: socket.socket) -> AbstractContextManager[None]:
    """With servers of its own for database and broker any number of processes may serve."""
    from app.services.upkeep.presence import only_server

    return only_server(settings, address_of(listening)) if settings.embedded else nullcontext()


def address_of(listening: socket.socket) -> str:
    host, port = listening.getsockname()[:2]
    return f"http://{f'[{host}]' if ':' in host else host}:{port}"


def stop_quietly(signum: int, frame: FrameType | None) -> None:
    """SIGTERM outside of the server's own handling, as while starting up, still runs what has to be cleaned up."""
    sys.exit(ExitCode.DONE)


def listen(host: str, port: int, *, at_once: bool = False) -> socket.socket:
    """A socket at that address. at_once: whether who connects waits there from now on: until somebody listens, others
    may take the same address. Raises RequestError("cannot_listen")."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family)
    # Connections inherit it. Without it a short answer, sent as head and body, waits 40 ms for the client's receipt.
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        if at_once:
            listening.listen(LARGEST_BURST)
    except OSError as error:
        listening.close()
        raise RequestError(
            "cannot_listen", f"cannot listen on {host} port {port}: {error.strerror or error}"
        ) from error
    return listening


def run(settings: "Settings", listening: socket.socket, keys_required: bool) -> None:
    import uvicorn

    from app.cli.supervisor import Child, Supervisor
    from app.main import create_app

    app = create_app(settings, keys_required=keys_required)
    if keys_required:
        tell_of_keys(settings)
    config = config_of(app)
    names = ("worker", "beat") if settings.embedded else ()
    supervisor = Supervisor([Child(name, (name, "--until-parent-ends")) for name in names], CHILDREN_GRACE_S)
    supervisor.start()
    try:
        say(f"loopaudit: serving on {address_of(listening)}" + beside(names))
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        supervisor.stop()
        say("loopaudit: stopped")


def config_of(app: "FastAPI") -> "uvicorn.Config":
    import uvicorn

    from app.http.connections import LARGEST_HEAD_BYTES, HeadDeadline

    return uvicorn.Config(
        app,
        http=HeadDeadline,
        h11_max_incomplete_event_size=LARGEST_HEAD_BYTES,
        limit_concurrency=connections_at_once(),
        backlog=LARGEST_BURST,
        server_header=False,
        log_config=None,
        access_log=False,
        timeout_graceful_shutdown=CONNECTIONS_GRACE_S,
    )


def connections_at_once() -> int:
    """As many as there are files for; fewer than usual are warned of. Each is one, and systems let a process open 1024
    unless it asks for more."""
    wanted = LARGEST_CROWD + OTHER_FILES
    allowed, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed == resource.RLIM_INFINITY or allowed >= wanted:
        return LARGEST_CROWD
    more = wanted if most == resource.RLIM_INFINITY else min(wanted, most)
    with suppress(OSError, ValueError):  # where it may not ask for more, it has what it has
        resource.setrlimit(resource.RLIMIT_NOFILE, (more, most))
        allowed = more
    connections = max(allowed - OTHER_FILES, allowed // 2)
    if connections < LARGEST_CROWD:  # one above them is closed without a word, which nobody could tell from a fault
        files = f"LimitNOFILE={wanted} of the service, or `ulimit -n`, gives it more"
        text = f"at most {connections} connections at once, because this process may open {allowed} files: {files}"
        say(f"loopaudit: warning: {text}", "warning")
    return connections


def tell_of_keys(settings: "Settings") -> None:
    """Without any key the service runs, and answers nobody; what is missing is said once."""
    from app.services.access.keys import any_active
    from app.services.backend import Backend
    from app.services.database_errors import DATABASE_AWAY

    backend = Backend.open(settings)
    try:
        there = any_active(backend)
    except DATABASE_AWAY:
        return
    finally:
        backend.close()
    if not there:
        text = "keys are asked for and there is none yet: `loopaudit keys create NAME --role admin` makes one"
        say(f"loopaudit: {text}", "warning")


def beside(names: tuple[str, ...]) -> str:
    if names:
        return f", with {' and '.join(names)}"
    return "; start `loopaudit worker` and `loopaudit beat` for themselves"
