"""A database of our own, an empty broker, and the product's own processes on them; all of it gone afterwards."""

import os
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import create_engine, make_url
from sqlalchemy.exc import SQLAlchemyError

from app.lab.bench.bench import Bench, SkippedError
from app.lab.bench.measure import children_of
from app.services.backend import Backend
from app.services.upkeep.tables import migrate
from app.settings import Settings
from app.threads import OF_LINEAR_ALGEBRA, READING_THREADS

READY_WITHIN_S = 900.0


@contextmanager
def plant_backend(bench: Bench, **changes: object) -> Iterator[Backend]:
    """The services on an empty database of a PostgreSQL server, with the broker in Redis."""
    with _database(bench.postgres) as url:
        _check_empty(bench.redis)
        folder = bench.folder / f"data-{uuid.uuid4().hex[:6]}"
        settings = Settings(database_url=url, broker_url=bench.redis, data_dir=folder, **changes)  # type: ignore[arg-type]
        migrate(settings)
        backend = Backend.open(settings, worker=True)
        try:
            yield backend
        finally:
            backend.close()
            _empty(bench.redis)


@contextmanager
def _database(server_url: str) -> Iterator[str]:
    try:
        server = create_engine(server_url, isolation_level="AUTOCOMMIT", connect_args={"connect_timeout": 3})
        name = f"loopaudit_bench_{uuid.uuid4().hex[:8]}"
        with server.connect() as connection:
            connection.exec_driver_sql(f'CREATE DATABASE "{name}"')
    except (SQLAlchemyError, ImportError) as error:
        raise SkippedError(f"no PostgreSQL server at {server_url}: {str(error).splitlines()[0]}") from error
    try:
        yield make_url(server_url).set(database=name).render_as_string(hide_password=False)
    finally:
        with server.connect() as connection:
            connection.exec_driver_sql(f'DROP DATABASE "{name}" WITH (FORCE)')
        server.dispose()


def _check_empty(url: str) -> None:
    """Raises SkippedError where there is no Redis, or somebody else's messages are in it."""
    try:
        import redis

        size = redis.Redis.from_url(url, socket_connect_timeout=3).dbsize()
    except Exception as error:
        raise SkippedError(f"no Redis server at {url}: {error}") from error
    if size:
        raise SkippedError(f"the Redis database {url} is not empty; name an empty one with --redis")


def _empty(url: str) -> None:
    import redis

    redis.Redis.from_url(url).flushdb()


@contextmanager
def process(backend: Backend, name: str, *arguments: str) -> Iterator["subprocess.Popen[bytes]"]:
    """A `loopaudit` command on the backend's database and broker, its output in the data folder."""
    settings = backend.settings
    environment = {k: v for k, v in os.environ.items() if not k.startswith("LOOPAUDIT_")} | {
        "LOOPAUDIT_DATABASE_URL": settings.resolved_database_url,
        "LOOPAUDIT_BROKER_URL": settings.resolved_broker_url,
        "LOOPAUDIT_DATA_DIR": str(settings.data_dir),
        "LOOPAUDIT_PLANT": settings.plant,  # by which the queues are named
        **dict.fromkeys(OF_LINEAR_ALGEBRA, "1"),
        **READING_THREADS,
    }
    log = settings.data_dir / f"{name}-{uuid.uuid4().hex[:6]}.log"
    with log.open("wb") as output:
        started = subprocess.Popen(  # noqa: S603 - our own command
            [sys.executable, "-m", "app", *arguments], env=environment, stdout=output, stderr=output
        )
        started.log = log  # type: ignore[attr-defined]
        try:
            yield started
        finally:
            started.terminate()
            try:
                started.wait(60)
            except subprocess.TimeoutExpired:
                started.kill()
                started.wait()


@contextmanager
def workers(backend: Backend, count: int) -> Iterator["subprocess.Popen[bytes]"]:
    """Worker processes whose kernels are compiled and loaded."""
    with process(backend, "worker", "worker", "--concurrency", str(count)) as started:
        _await(started, lambda: len(children_of(started.pid)) >= count and _says(started, "ready"))
        yield started


@contextmanager
def service(backend: Backend) -> Iterator[tuple[str, int]]:
    """Address and process of `loopaudit serve`."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with process(backend, "serve", "serve", "--port", str(port)) as started:
        _await(started, lambda: _listens(port))
        yield f"http://127.0.0.1:{port}", started.pid


def _await(started: "subprocess.Popen[bytes]", ready: "object") -> None:
    deadline = time.monotonic() + READY_WITHIN_S
    while not ready():  # type: ignore[operator]
        if started.poll() is not None or time.monotonic() > deadline:
            tail = Path(started.log).read_text(errors="replace")[-1500:]  # type: ignore[attr-defined]
            raise SkippedError(f"{started.args[-2:]!r} did not come up: {tail}")  # type: ignore[index]  # a list here
        time.sleep(0.1)


def _says(started: "subprocess.Popen[bytes]", word: str) -> bool:
    return word in Path(started.log).read_text(errors="replace")  # type: ignore[attr-defined]


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
