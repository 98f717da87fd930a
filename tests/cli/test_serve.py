"""What `serve` listens on, and where it asks for keys."""

import asyncio
import os
import resource
import socket
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from fastapi import FastAPI
from uvicorn.server import ServerState

from app.cli import serve as serving
from app.cli.serve import asks_for_keys, connections_at_once, listen, only_one, warn_of_openness
from app.errors import RequestError
from app.http.connections import HeadDeadline
from app.services.upkeep.presence import LOCK, SERVING, alone, only_server
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests import forked


def test_short_answers_are_sent_at_once() -> None:
    with listen("127.0.0.1", 0) as listening:
        listening.listen()
        with socket.create_connection(listening.getsockname()), listening.accept()[0] as accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.parametrize("command", [("serve", "--port", "0"), ("worker",), ("beat",)], ids=" ".join)
def test_nothing_is_restored_under_what_runs(tmp_path: Path, command: tuple[str, ...]) -> None:
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    environment = {**os.environ, "LOOPAUDIT_DATA_DIR": str(settings.data_dir)}
    with (tmp_path / "log").open("w") as log:
        running = forked.command(*command, env=environment, stdout=log, stderr=log)
    try:
        until = time.monotonic() + 30.0
        while not (settings.data_dir / LOCK).exists():
            assert time.monotonic() < until
            time.sleep(0.1)
        time.sleep(0.5)  # between making the file and locking it
        assert not is_free(settings)
    finally:
        running.terminate()
        running.wait(60)
    assert is_free(settings)


def test_a_second_server_on_a_data_folder_is_refused_until_the_first_one_ends_however_it_ends(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    environment = {**os.environ, "LOOPAUDIT_DATA_DIR": str(settings.data_dir)}
    with (tmp_path / "log").open("w") as log:
        running = forked.command("serve", "--port", "0", env=environment, stdout=log, stderr=log)
    try:
        until = time.monotonic() + 60.0
        while not ((settings.data_dir / SERVING).exists() and (settings.data_dir / SERVING).read_text()):
            assert time.monotonic() < until
            time.sleep(0.1)
        second = forked.run("serve", "--port", "0", env=environment, timeout=60)
    finally:
        running.kill()
    assert second.returncode == 2
    assert "is running already on http://127.0.0.1:" in second.stderr
    assert f"(process {running.pid}), with the data folder {settings.data_dir}" in second.stderr
    assert second.stderr.endswith("[already_serving]\n")
    with only_server(settings, "http://127.0.0.1:1"):
        pass


def test_with_a_broker_of_its_own_any_number_may_serve(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path, broker_url="redis://127.0.0.1:1/0")
    with (
        listen("127.0.0.1", 0) as one,
        listen("127.0.0.1", 0) as other,
        only_one(settings, one),
        only_one(settings, other),
    ):
        assert not (tmp_path / SERVING).exists()


def is_free(settings: Settings) -> bool:
    try:
        with alone(settings):
            return True
    except RequestError as error:
        assert error.code == "still_running"  # noqa: PT017 - a look, not an expectation
        return False


@pytest.mark.parametrize(
    ("host", "keys_required", "warned"),
    [("0.0.0.0", False, True), ("0.0.0.0", True, False), ("127.0.0.1", False, False), ("::", False, True)],  # noqa: S104 - what is warned of
)
def test_serving_without_keys_beyond_loopback_is_warned_of(
    capsys: pytest.CaptureFixture[str], host: str, keys_required: bool, warned: bool
) -> None:
    warn_of_openness(host, keys_required)
    told = capsys.readouterr().err
    assert bool(told) == warned
    assert not told or f"no key is asked for on {host}" in told


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "plant-server", ""])  # noqa: S104 - asks for keys
def test_serve_asks_for_keys_beyond_loopback(tmp_path, host):
    assert asks_for_keys(host, Settings(data_dir=tmp_path))
    assert not asks_for_keys(host, Settings(data_dir=tmp_path, allow_open=True))
    assert asks_for_keys(host, Settings(data_dir=tmp_path, allow_open=True, require_keys=True))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_serve_asks_for_keys_on_loopback_where_it_is_told_to(tmp_path, host):
    assert not asks_for_keys(host, Settings(data_dir=tmp_path))
    assert asks_for_keys(host, Settings(data_dir=tmp_path, require_keys=True))


@pytest.mark.parametrize(
    ("allowed", "most", "asked_for", "connections"),
    [
        (1024, 4096, 2500, 2000),
        (1024, resource.RLIM_INFINITY, 2500, 2000),
        (1024, 1024, 1024, 524),
        (256, 300, 300, 150),
        (20_000, 20_000, None, 2000),
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY, None, 2000),
    ],
)
def test_connections_leave_files_for_what_they_ask_and_few_are_warned_of(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    allowed: int,
    most: int,
    asked_for: int | None,
    connections: int,
) -> None:
    asked = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (allowed, most))
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: asked.append(limits))
    assert connections_at_once() == connections
    told = " ".join(capsys.readouterr().err.split())
    few = f"at most {connections} connections at once, because this process may open {asked_for} files: LimitNOFILE"
    assert few in told if connections < 2000 else not told
    assert asked == ([] if asked_for is None else [(asked_for, most)])


@pytest.mark.parametrize("error", [ValueError("not allowed to raise maximum limit"), PermissionError(1, "no")])
def test_where_more_files_are_not_given_there_are_fewer_connections(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def refuse(_: int, limits: tuple[int, int]) -> None:
        raise error

    monkeypatch.setattr(resource, "getrlimit", lambda _: (1024, 4096))
    monkeypatch.setattr(resource, "setrlimit", refuse)
    assert connections_at_once() == 524


def test_connections_that_come_at_once_take_no_more_files_than_there_are_for_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Those above the limit are closed, but each is open until then."""
    monkeypatch.setattr(serving, "connections_at_once", lambda: 20)
    config = serving.config_of(FastAPI())
    config.load()
    state, open_now, most = ServerState(), [0], [0]

    class Counted(HeadDeadline):
        def connection_made(self, transport: asyncio.Transport) -> None:
            open_now[0] += 1
            most[0] = max(most[0], open_now[0])
            super().connection_made(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            open_now[0] -= 1
            super().connection_lost(exc)

    async def serve_those_that_came() -> None:
        loop = asyncio.get_running_loop()
        listening = await loop.create_server(
            lambda: Counted(config=config, server_state=state, app_state={}), "127.0.0.1", 0, backlog=config.backlog
        )
        async with listening:
            with ExitStack() as clients:
                for _ in range(300):
                    client = clients.enter_context(socket.socket())
                    client.setblocking(False)
                    client.connect_ex(listening.sockets[0].getsockname())
                while most[0] == 0 or open_now[0] > 10:
                    await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(serve_those_that_came(), 60))
    assert 10 < most[0] <= serving.OTHER_FILES // 2
