"""What all tests share: where the recordings beside the project are, and which servers this machine has."""

import gc
import os
import pickle
import shutil
import socket
import ssl
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Hashable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Generic, TypeVar

import httpx
import hypothesis
import psycopg
import pytest
import uvicorn
from fastapi import FastAPI
from sqlalchemy import Engine, create_engine, event, make_url
from sqlalchemy.exc import OperationalError

from app.__main__ import BETWEEN_LOOKS
from app.engine.mismatch import Comparison, Explanation, explain
from app.services.auditing import chunks, warming
from app.services.backend import Backend
from app.services.explaining import working
from app.services.upkeep.tables import migrate
from app.settings import Settings
from app.storage import Database
from app.storage import database as storage_database
from app.storage.tables import metadata
from tests.audited import audited

SHARED = Path(__file__).resolve().parents[2] / "shared"
# Files that take long, whatever the number of their tests: begun last, they would keep one core waiting for the other.
LONG = (
    *("/e2e/", "/chaos/", "/load/", "/workers/", "/web/", "/digests/"),
    *("test_hostile", "test_read", "/test_start.py", "test_types", "test_sizing", "test_upgrades"),
)

# No test is of how long something takes: the first call of a kernel compiles or loads it, and the machine may be busy.
hypothesis.settings.register_profile(
    "whatever_the_time",
    parent=hypothesis.settings(),
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("whatever_the_time")


# As a command does at its start: what the test files import was looked through for garbage for a sixth of their time.
gc.set_threshold(BETWEEN_LOOKS)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The long files first; otherwise in the order in which they were found."""
    items.sort(key=lambda item: not any(part in item.path.as_posix() for part in LONG))


class _Compiled(dict[Any, Any]):
    """Compiled statements by dialect's name, not by the object that each engine has of it."""

    def __getitem__(self, key: Any) -> Any:
        return super().__getitem__(_named(key))

    def __setitem__(self, key: Any, compiled: Any) -> None:
        super().__setitem__(_named(key), compiled)

    def get(self, key: Any, default: Any = None) -> Any:
        return super().get(_named(key), default)


def _named(key: Any) -> Any:
    return (key[0].name, *key[1:])


@pytest.fixture(scope="session", autouse=True)
def statements_are_compiled_once() -> Iterator[None]:
    """Each test opens engines of its own, which would compile the same statements anew: a sixth of what they cost."""
    compiled = _Compiled()

    def engine(*args: Any, **options: Any) -> Engine:
        return create_engine(*args, **options).execution_options(compiled_cache=compiled)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(storage_database, "create_engine", engine)
        yield


OPENED_BY_THE_PRODUCT = storage_database._sqlite


def _not_synced(*args: Any, **options: Any) -> Engine:
    engine = OPENED_BY_THE_PRODUCT(*args, **options)
    event.listen(engine, "connect", lambda connection, _: connection.execute("PRAGMA synchronous = OFF"))
    return engine


@pytest.fixture(scope="session", autouse=True)
def commits_need_not_outlive_the_machine() -> Iterator[None]:
    """As on PostgreSQL: what a test has committed is asked while the machine runs, not after it lost its power. To wait
    for the disk took most of a commit. Servers and workers of their own process are not touched.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(storage_database, "_sqlite", _not_synced)
        yield


@pytest.fixture
def commits_outlive_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(storage_database, "_sqlite", OPENED_BY_THE_PRODUCT)


def pytest_collection_finish() -> None:
    """What was loaded and collected stays, and is not looked through for garbage again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """The folder of recordings beside the project; the test is skipped where it is not there."""
    if not SHARED.is_dir():
        pytest.skip("no folder ../shared with recordings beside the project")
    return SHARED


def servers_required() -> bool:
    """Whether PostgreSQL and Redis must be there (as in CI), instead of skipping their tests."""
    return os.environ.get("LOOPAUDIT_TEST_REQUIRE_SERVERS") == "1"


POSTGRES = os.environ.get("LOOPAUDIT_TEST_POSTGRES_URL", "postgresql+psycopg://127.0.0.1/postgres")
REDIS = os.environ.get("LOOPAUDIT_TEST_REDIS_URL", "redis://127.0.0.1:6379")
FIRST_REDIS_DATABASE = 8


def _no_server(what: str) -> None:
    if servers_required():
        pytest.fail(f"no {what} server, and LOOPAUDIT_TEST_REQUIRE_SERVERS is set")
    pytest.skip(f"no {what} server on this machine")


@contextmanager
def bare_postgres() -> Iterator[str]:
    """A database without any table on the local PostgreSQL server, dropped at the end."""
    server = create_engine(POSTGRES, isolation_level="AUTOCOMMIT", connect_args={"connect_timeout": 2})
    name = f"loopaudit_test_{os.getpid()}_{uuid.uuid4().hex[:8]}"
    try:
        with server.connect() as connection:
            connection.exec_driver_sql(f'CREATE DATABASE "{name}"')
            # What a test has committed is asked of this server while it runs, not after it lost its power.
            connection.exec_driver_sql(f'ALTER DATABASE "{name}" SET synchronous_commit TO off')
    except OperationalError:
        _no_server("PostgreSQL")
    try:
        yield make_url(POSTGRES).set(database=name).render_as_string(hide_password=False)
    finally:
        with server.connect() as connection:
            connection.exec_driver_sql(f'DROP DATABASE "{name}" WITH (FORCE)')
        server.dispose()


@contextmanager
def own_postgres() -> Iterator[str]:
    """A database with this version's tables on the local PostgreSQL server, dropped at the end."""
    with bare_postgres() as url:
        migrate(Settings(database_url=url, data_dir=Path(tempfile.gettempdir())))
        yield url


@pytest.fixture(scope="session")
def postgres_url() -> Iterator[str]:
    """The database of this test session: which test gets it, gets it empty."""
    with own_postgres() as url:
        yield url
        _emptying(url).close()


@pytest.fixture(scope="session")
def empty_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A SQLite file with this version's tables, to be copied."""
    folder = tmp_path_factory.mktemp("empty")
    migrate(Settings(data_dir=folder))
    return folder / "loopaudit.db"


MakeTables = Callable[[Settings], None]


@pytest.fixture(scope="session")
def make_tables(empty_sqlite: Path) -> MakeTables:
    """Gives the folder of these settings, on the embedded default, what `migrate` would: it walks through every version
    there ever was, for a tenth of a second.
    """

    def made(settings: Settings) -> None:
        settings.prepare_folders()
        shutil.copy(empty_sqlite, settings.data_dir / "loopaudit.db")

    return made


@pytest.fixture
def redis_url(worker_id: str) -> Iterator[str]:
    """A database of the local Redis server that is empty, and is emptied again."""
    redis = pytest.importorskip("redis")
    number = FIRST_REDIS_DATABASE + (int(worker_id.removeprefix("gw")) if worker_id != "master" else 0) % 6
    url = f"{REDIS}/{number}"
    client = redis.Redis.from_url(url, socket_connect_timeout=2)
    try:
        client.flushdb()
    except redis.exceptions.ConnectionError:
        _no_server("Redis")
    yield url
    client.flushdb()
    client.close()


@pytest.fixture(params=["sqlite", "postgresql"])
def settings(request: pytest.FixtureRequest, tmp_path: Path) -> Settings:
    """Settings of an empty plant on each database, with a data folder of its own and the broker in a folder."""
    url = ""
    if request.param == "postgresql":
        url = request.getfixturevalue("emptied_postgres")
    else:
        shutil.copy(request.getfixturevalue("empty_sqlite"), tmp_path / "loopaudit.db")
    return Settings(data_dir=tmp_path, database_url=url)


@pytest.fixture
def emptied_postgres(postgres_url: str) -> str:
    empty_tables(postgres_url)
    return postgres_url


def empty_tables(url: str) -> None:
    """By rows, and numbers begin anew: to TRUNCATE makes the files of all tables anew, half a second each time."""
    numbers = "SELECT setval(oid, 1, false) FROM pg_class WHERE relkind = 'S' AND relnamespace = 'public'::regnamespace"
    rows = [f"DELETE FROM {table.name}" for table in reversed(metadata.sorted_tables)]  # noqa: S608 - our own tables
    _emptying(url).execute("; ".join([*rows, numbers]))


@cache
def _emptying(url: str) -> psycopg.Connection[Any]:
    """One for all tests: before each of them there would be another one to be made."""
    return psycopg.connect(url.replace("+psycopg", ""), autocommit=True)


@pytest.fixture(scope="session")
def warm_kernels() -> None:
    """As a worker does before its first loop: no time limit, of a loop or of a test, is to pay for compiling."""
    warming.warm_up()


T = TypeVar("T")


@dataclass(frozen=True)
class _Told(Generic[T]):
    """Something that is told by what it holds."""

    by: Hashable
    it: T = field(compare=False)


@pytest.fixture(scope="session", autouse=True)
def audits_are_made_once() -> Iterator[None]:
    """The engine is pure, and most tests of services audit the same few loops: one recording is audited once a session
    under one configuration, also in the plants that all tests of a module share. Workers of their own process are not
    touched.
    """

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chunks, "audit", audited)
        yield


@lru_cache(maxsize=200)
def _explained_once(comparison: _Told[Comparison]) -> Explanation:
    return explain(comparison.it)


@pytest.fixture(scope="session", autouse=True)
def explanations_are_made_once() -> Iterator[None]:
    """As audits, on both databases and by whatever way a comparison comes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(working, "explain", lambda it: _explained_once(_Told(pickle.dumps(it), it)))
        yield


@pytest.fixture
def backend(settings: Settings) -> Iterator[Backend]:
    """The services' backend of an empty plant."""
    opened = Backend.open(settings)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def open_plant(tmp_path_factory: pytest.TempPathFactory, make_tables: MakeTables) -> Iterator[Callable[..., Backend]]:
    """Opens an empty plant on the embedded default, with given settings, until the module's last test has run."""
    with ExitStack() as stack:

        def opened(**settings: object) -> Backend:
            made = Settings(data_dir=tmp_path_factory.mktemp("plant"), **settings)
            make_tables(made)
            backend = Backend.open(made)
            stack.callback(backend.close)
            return backend

        yield opened


@pytest.fixture
def database(backend: Backend) -> Database:
    """An empty database with this version's tables, on SQLite and on PostgreSQL."""
    return backend.database


Serve = Callable[[FastAPI], "contextmanager[httpx.Client]"]


@contextmanager
def listening(app: FastAPI, **options: Any) -> Iterator[tuple[str, int]]:
    """A real server on a free port, and its address; options: of uvicorn."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        config = uvicorn.Config(app, log_level="critical", timeout_graceful_shutdown=1, **options)
        server = uvicorn.Server(config)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        deadline = time.monotonic() + 20
        while not server.started:
            assert time.monotonic() < deadline, "the server did not start"
            assert thread.is_alive(), "the server ended"
            time.sleep(0.01)
        try:
            yield listener.getsockname()
        finally:
            server.should_exit = True
            thread.join(timeout=20)


@cache
def authorities() -> ssl.SSLContext:
    """Whom a client trusts: each would read all certificates anew, for 20 ms."""
    return httpx.create_ssl_context()


@contextmanager
def served(app: FastAPI) -> Iterator[httpx.Client]:
    """A client of a real server: paths, headers and bodies arrive as a client's do."""
    with listening(app) as (host, port):
        url = f"http://{host}:{port}"
        with httpx.Client(base_url=url, timeout=30, verify=authorities()) as client:
            yield client


@pytest.fixture(scope="session")
def serve() -> Serve:
    return served
