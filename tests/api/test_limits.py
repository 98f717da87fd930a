"""Slow senders, crowds and full disks: told in time, and nothing is left of what was turned away."""

import asyncio
import errno
import os
import resource
import shutil
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from starlette.exceptions import HTTPException

from app.http import bodies, connections, crowding, receiving
from app.main import create_app
from app.services import data_folder
from app.services.intake import uploads
from app.services.plant import reliability
from app.settings import Settings
from tests.conftest import listening


@pytest.fixture
def settings(tmp_path, make_tables) -> Settings:
    made = Settings(data_dir=tmp_path, idle_timeout_s=0.3, upload_deadline_s=1.0, max_uploads=2, max_requests=3)
    make_tables(made)
    return made


@pytest.fixture
def client(serve, settings):
    with serve(create_app(settings)) as connection:
        yield connection


def slowly(client, head: bytes, parts: list[bytes], pause_s: float) -> bytes:
    """Sends a request by hand, with a pause before each part of the body; the whole answer."""
    with socket.create_connection((client.base_url.host, client.base_url.port), timeout=20) as connection:
        connection.sendall(head)
        for part in parts:
            time.sleep(pause_s)
            try:
                connection.sendall(part)
            except OSError:
                break
        answer = b""
        while got := connection.recv(65536):
            answer += got
        return answer


def head(path: str, length: int, kind: str = "application/json") -> bytes:
    return (
        f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\r\n".encode()
    )


@pytest.mark.parametrize("path", ["/v1/uploads", "/v1/audits"])
def test_a_sender_that_stops_is_turned_away(client, settings, path):
    started = time.monotonic()
    answer = slowly(client, head(path, 1000), [b"x"], 0)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b'"code":"too_slow"' in answer
    assert time.monotonic() - started < 5
    assert not list(settings.uploads_dir.glob(".part-*"))


def test_a_sender_that_trickles_is_turned_away_at_the_deadline(client, settings):
    answer = slowly(client, head("/v1/uploads", 1000), [b"x"] * 30, 0.1)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert not list(settings.uploads_dir.iterdir())


def test_parts_that_come_in_time_do_not_move_the_deadline():
    async def trickle():
        await asyncio.sleep(0.02)
        return {"type": "http.request", "body": b"x", "more_body": True}

    async def taken() -> None:
        receive = bodies.timely(trickle, idle_s=10.0, deadline_s=0.2)
        for _ in range(100):
            await receive()

    with pytest.raises(HTTPException) as refused:
        asyncio.run(taken())
    assert refused.value.status_code == 408


def test_a_body_without_a_length_may_be_as_long_as_the_limit_and_no_longer():
    async def part():
        return {"type": "http.request", "body": b"1234", "more_body": True}

    async def taken(limit: int) -> None:
        receive = bodies.counted(part, limit)
        for _ in range(2):
            await receive()

    asyncio.run(taken(8))
    with pytest.raises(HTTPException) as refused:
        asyncio.run(taken(7))
    assert refused.value.status_code == 413


def test_above_the_limit_uploads_are_asked_to_come_again_and_others_go_on(client):
    held = [socket.create_connection((client.base_url.host, client.base_url.port)) for _ in range(2)]
    try:
        for connection in held:
            connection.sendall(head("/v1/uploads", 1000) + b"x")
        time.sleep(0.15)
        answer = client.post("/v1/uploads", content=b"time,PV,OP\n")
        assert (answer.status_code, answer.json()["code"]) == (503, "busy")
        assert int(answer.headers["retry-after"]) > 0
        assert client.get("/v1/loops").status_code == 200
    finally:
        for connection in held:
            connection.close()
    deadline = time.monotonic() + 10
    while client.post("/v1/uploads", content=b"time,PV,OP\n0,1,2\n").status_code == 503:
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.parametrize(
    "request_", [head("/login", 1000, "application/x-www-form-urlencoded") + b"key=", head("/static/x", 1000) + b"x"]
)
def test_whoever_has_no_key_takes_no_place_of_those_who_have_one(client, settings, monkeypatch, request_):
    monkeypatch.setattr(crowding, "read_in_time", held_back)
    places = settings.max_requests + 1
    held = [socket.create_connection((client.base_url.host, client.base_url.port)) for _ in range(places)]
    try:
        for connection in held:
            connection.sendall(request_)
        time.sleep(0.1)
        assert client.get("/v1/loops").status_code == 200
    finally:
        for connection in held:
            connection.close()


def held_back(send):
    """As if whoever asked did not read the answer; what the test itself asks is answered."""

    async def send_late(message) -> None:
        if message.get("status") not in (None, 200):
            await asyncio.sleep(0.5)
        await send(message)

    return send_late


def test_a_long_mapping_is_looked_at_away_from_the_event_loop(client, monkeypatch):
    seen, receive = [], receiving.service.receive

    def received(*arguments, **named):
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            seen.append("in a thread of its own")
        return receive(*arguments, **named)

    monkeypatch.setattr(receiving.service, "receive", received)
    files = {"file": ("a.csv", b"time,T1\n0,1\n"), "mapping": ("m.csv", b"tag,loop,signal\nT1,FIC1,PV\n")}
    assert client.post("/v1/uploads", files=files).status_code == 202
    assert seen == ["in a thread of its own"]


def test_files_of_forms_are_spooled_where_the_disk_is_watched(client, settings, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", "/proc/no-folder-of-temporary-files")
    export = b"time,FIC1.PV,FIC1.OP\n" + b"0,1,2\n" * 400_000  # more than is kept in memory
    answer = client.post("/v1/uploads", files={"file": ("a.csv", export)})
    assert (answer.status_code, answer.json()["size_bytes"]) == (202, len(export))
    assert len(list(settings.uploads_dir.iterdir())) == 1  # and nothing is left of what was spooled


def test_slow_logins_of_one_address_shut_out_neither_the_styles_nor_the_other_addresses(client, monkeypatch):
    monkeypatch.setattr(crowding, "OF_AN_ADDRESS", {"logins": 2, "files": 2})
    sent = head("/login", 1000, "application/x-www-form-urlencoded") + b"key="
    held = [socket.create_connection((client.base_url.host, client.base_url.port)) for _ in range(2)]
    try:
        for connection in held:
            connection.sendall(sent)
        time.sleep(0.1)
        assert client.get("/login").status_code == 503
        assert client.get("/static/loopaudit.css").status_code == 200
    finally:
        for connection in held:
            connection.close()


def test_addresses_that_have_been_answered_are_not_kept(settings):
    async def answered(*_) -> None:
        return

    crowd = crowding.LimitCrowd(answered, settings)
    for number in range(20):
        asked = {"type": "http", "method": "GET", "path": "/login", "client": (f"10.0.{number}.1", 80)}
        asyncio.run(crowd(asked, answered, answered))
    assert not crowd._of_address


def test_a_login_has_few_bytes(client):
    answer = client.post("/login", data={"key": "k" * bodies.LOGIN_BYTES})
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")


def test_few_mappings_are_held_in_memory_at_a_time(serve, tmp_path, make_tables, monkeypatch):
    inside, most, lock, receive = set(), [], threading.Lock(), receiving.service.receive

    def counted(*arguments, **named):
        with lock:
            inside.add(named["filename"])
            most.append(len(inside))
        time.sleep(0.1)
        with lock:
            inside.remove(named["filename"])
        return receive(*arguments, **named)

    monkeypatch.setattr(receiving.service, "receive", counted)
    made = Settings(data_dir=tmp_path)
    make_tables(made)

    def send(number: int) -> int:
        mapping = ("m.csv", b"tag,loop,signal\nT1,FIC1,PV\n")
        files = {"file": (f"{number}.csv", b"time,T1\n0,1\n"), "mapping": mapping}
        return client.post("/v1/uploads", files=files).status_code

    with serve(create_app(made)) as client, ThreadPoolExecutor(8) as pool:
        assert set(pool.map(send, range(8))) == {202}
    assert max(most) == receiving.MAPPINGS_AT_ONCE


EXPORT = ("a.csv", b"time,T1\n0,1\n")
TOO_LARGE = "tag,loop,signal\nT1,FIC1,PV\n"


@pytest.mark.parametrize("part", [("m.csv", TOO_LARGE.encode()), (None, TOO_LARGE.encode())], ids=["file", "text"])
def test_a_mapping_that_is_too_large_is_refused_and_not_cut(client, settings, monkeypatch, part):
    monkeypatch.setattr(receiving, "LARGEST_MAPPING", 20)
    answer = client.post("/v1/uploads", files={"file": EXPORT, "mapping": part})
    assert (answer.status_code, answer.json()["code"]) == (413, "mapping_too_large")
    assert not list(settings.uploads_dir.iterdir())


@pytest.mark.parametrize("sent", [{"files": {"mapping": (None, TOO_LARGE)}}, {"data": {"mapping": TOO_LARGE}}])
def test_a_mapping_of_the_page_is_as_large_as_any_other(client, monkeypatch, sent):
    number = client.post("/v1/uploads", files={"file": EXPORT}).json()["id"]
    monkeypatch.setattr(receiving, "LARGEST_MAPPING", 20)
    answer = client.post(f"/uploads/{number}/mapping", **sent)
    assert (answer.status_code, answer.json()["code"]) == (413, "mapping_too_large")


def plant_mapping() -> str:
    """14,000 loops of four tags with every column, as a page sends its lines."""
    signals = ("PV", "OP", "SP", "MODE")
    loops = ((f"UNIT{n // 500:02d}-FIC{n:05d}", n // 500) for n in range(14_000))
    rows = (f"{tag}/{one},{tag},{one},UNIT{unit:02d},flow,feed of column {unit:02d},1,t/h,0,100,0,100,false"
            for tag, unit in loops for one in signals)  # fmt: skip
    head = "tag,loop,signal,unit,type,description,importance,pv_unit,pv_low,pv_high,op_low,op_high,integrating"
    return "\r\n".join((head, *rows))


def test_the_mapping_of_a_whole_plant_is_taken_as_a_text_too(serve, tmp_path, make_tables):
    made, mapping = Settings(data_dir=tmp_path), plant_mapping()
    assert len(mapping) > 4.8e6
    make_tables(made)
    with serve(create_app(made)) as client:
        first = client.post("/v1/uploads", files={"file": EXPORT, "mapping": (None, mapping)})
        assert first.status_code == 202, first.text
        again = client.post(f"/uploads/{first.json()['id']}/mapping", files={"mapping": (None, mapping + "\r\n")})
        assert again.status_code == 303, again.text
        encoded = client.post(f"/uploads/{first.json()['id']}/mapping", data={"mapping": mapping + "\r\n\r\n"})
        assert encoded.status_code == 303, encoded.text
        too_much = client.post(f"/uploads/{first.json()['id']}/mapping", content=b"x" * (18 << 20))
        assert (too_much.status_code, too_much.json()["code"]) == (413, "body_too_large")


def test_a_mapping_that_was_left_blank_is_none(client):
    sent = client.post("/v1/uploads", files={"file": EXPORT, "mapping": (None, "")})
    assert sent.status_code == 202
    blank = client.post(f"/uploads/{sent.json()['id']}/mapping", files={"mapping": (None, "")})
    assert (blank.status_code, blank.json()["code"]) == (422, "invalid_request")


def test_what_is_larger_than_the_disk_is_refused_and_not_to_be_sent_again(client, settings, monkeypatch):
    """It would never find room, however long whoever sends it tries."""
    monkeypatch.setattr(bodies.shutil, "disk_usage", lambda _: SimpleNamespace(total=99))
    answer = client.post("/v1/uploads", content=b"x" * 100)
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
    assert "retry-after" not in answer.headers
    assert "the body has 100 bytes, and the disk of the service 99 in all; send it in parts" in answer.json()["detail"]
    assert client.post("/v1/audits", json={}).status_code != 413


def test_a_full_disk_is_507_and_nothing_is_left(client, settings, monkeypatch):
    from app.services.intake.uploads import Receiving

    written = Receiving.write

    def full(self, data: bytes) -> None:
        written(self, data)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Receiving, "write", full)
    answer = client.post("/v1/uploads", content=b"time,PV,OP\n0,1,2\n")
    assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
    assert not list(settings.uploads_dir.iterdir())
    monkeypatch.undo()
    assert client.post("/v1/uploads", content=b"time,PV,OP\n0,1,2\n").status_code == 202


@pytest.fixture
def files_of_at_most() -> Iterator[Callable[[int], None]]:
    """What `ulimit -f` sets."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda most_bytes: resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("sent", [{"content": b"x" * 3_000_000}, {"files": {"file": ("a.csv", b"x" * 3_000_000)}}])
def test_a_file_longer_than_the_system_lets_it_be_is_413(client, settings, files_of_at_most, sent):
    files_of_at_most(2_000_000)
    answer = client.post("/v1/uploads", **sent)
    assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")
    assert "ulimit -f" in answer.json()["detail"]
    assert not list(settings.uploads_dir.iterdir())
    files_of_at_most(4_000_000)
    assert client.post("/v1/uploads", **sent).status_code == 202


@pytest.mark.parametrize(
    "sent", [{"content": b"time,PV,OP\n0,1,2\n"}, {"files": {"file": ("a.csv", b"x" * 3_000_000)}}]
)
@pytest.mark.parametrize("how", ["gone", "read-only"])
def test_a_data_folder_that_takes_nothing_is_503_until_it_does(client, settings, monkeypatch, sent, how):
    """A share that is away, or a disk that the system made read-only after an error: no fault of the program."""
    away = settings.data_dir / "away"
    if how == "gone":
        settings.uploads_dir.rename(away)
    else:
        monkeypatch.setattr(data_folder.os, "access", lambda path, mode: mode == os.F_OK)
        monkeypatch.setattr(uploads.SyncedFile, "__init__", _read_only)
        monkeypatch.setattr(tempfile, "TemporaryFile", _read_only)
    answer = client.post("/v1/uploads", **sent)
    assert (answer.status_code, answer.json()["code"]) == (503, "data_folder_away")
    assert answer.headers["retry-after"]
    monkeypatch.undo()
    if how == "gone":
        away.rename(settings.uploads_dir)
    assert not list(settings.uploads_dir.iterdir())
    assert client.post("/v1/uploads", **sent).status_code == 202


def _read_only(*_: object, **__: object) -> None:
    raise OSError(errno.EROFS, "Read-only file system")


def test_a_data_folder_that_is_gone_hides_neither_state_nor_figures(client, settings, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", _gone)
    answer = client.get("/readyz")
    assert (answer.status_code, answer.json()["state"]) == (503, "not_ready")
    assert "loopaudit_data_folder_free_bytes 0\n" in client.get("/metrics").text
    assert client.get("/v1/loops").status_code == 200


def _gone(_: object) -> None:
    raise FileNotFoundError(errno.ENOENT, "No such file or directory")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_draft_on_a_really_full_device_is_taken_away(client, settings, monkeypatch):
    from app.services.intake import uploads

    opened = uploads.Receiving.__init__

    def onto_full(self, backend, values) -> None:
        opened(self, backend, values)
        self._file._file.close()
        self._file._file = open("/dev/full", "wb", buffering=0)  # noqa: SIM115 - closed by what is tested

    monkeypatch.setattr(uploads.Receiving, "__init__", onto_full)
    answer = client.post("/v1/uploads", content=b"x" * 3_000_000)
    assert (answer.status_code, answer.json()["code"]) == (507, "disk_full")
    assert not list(settings.uploads_dir.iterdir())


def test_a_head_that_does_not_end_closes_the_connection(settings, monkeypatch):
    monkeypatch.setattr(connections, "HEAD_DEADLINE_S", 0.3)
    with listening(create_app(settings), http=connections.HeadDeadline) as address:
        for sent in (b"", b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nX-A: "):
            with socket.create_connection(address, timeout=10) as connection:
                connection.sendall(sent)
                assert connection.recv(1000) == b""
        with socket.create_connection(address, timeout=10) as connection:
            connection.sendall(b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
            assert connection.recv(1000).startswith(b"HTTP/1.1 200")


def test_a_client_that_does_not_read_its_answer_is_given_up(client, monkeypatch):
    size = 60_000_000  # more than sockets hold
    monkeypatch.setattr(reliability.TableParts, "as_json", lambda _: bytes(size))
    assert len(client.get("/v1/reliability").content) == size
    monkeypatch.setattr(crowding, "SLOWEST_READER_S", 0.3)
    with socket.create_connection((client.base_url.host, client.base_url.port), timeout=20) as connection:
        connection.sendall(b"GET /v1/reliability HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        time.sleep(1.5)
        got = 0
        try:
            while part := connection.recv(1 << 20):
                got += len(part)
        except ConnectionError:
            pass
    assert 0 < got < size
