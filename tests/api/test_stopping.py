"""A service that is stopped amid a request that it waits no longer for: told as what it is, and nothing is left."""

import asyncio
import json
import socket
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.http.stopping import AnswerWhenStopped
from app.main import create_app
from app.services.access import trail
from app.services.backend import Backend
from app.services.stating import notes
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.conftest import listening


def begun(address: tuple[str, int], head: str, body: bytes) -> socket.socket:
    connection = socket.create_connection(address, timeout=10)
    connection.sendall(f"{head} HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n".encode() + body)
    return connection


def answer_of(connection: socket.socket) -> tuple[int, dict[str, Any]]:
    with connection, connection.makefile("rb") as file:
        head, _, body = file.read().partition(b"\r\n\r\n")
    assert b"x-content-type-options: nosniff" in head.lower()
    return int(head.split()[1]), json.loads(body)


def test_what_the_service_waits_no_longer_for_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings, at_it, ends = Settings(data_dir=tmp_path), threading.Event(), threading.Event()
    migrate(settings)

    def writes_for_long(*_: Any, **__: Any) -> None:
        at_it.set()
        ends.wait(20)

    def noted_late(*noted: Any, **detail: Any) -> None:
        time.sleep(0.3)
        record(*noted, **detail)

    record = trail.record
    monkeypatch.setattr(trail, "record", noted_late)
    monkeypatch.setattr(notes, "add_note", writes_for_long)
    with listening(create_app(settings)) as address:
        sending = begun(address, "POST /v1/uploads", b"Content-Length: 1000\r\n\r\ntime,FIC1.PV")
        writing = begun(address, "POST /v1/loops/FIC1/notes", b"Content-Length: 13\r\n\r\n" + b'{"text":"it"}')
        assert at_it.wait(10)
    ends.set()
    upload, note = answer_of(sending), answer_of(writing)
    assert (upload[0], upload[1]["code"]) == (503, "unavailable")
    assert "being stopped" in upload[1]["detail"]
    assert (note[0], note[1]["code"]) == (504, "outcome_unknown")
    assert not list(settings.uploads_dir.iterdir())
    backend = Backend.open(settings)
    assert {row.outcome for row in trail.list_trail(backend).rows} == {"not_known"}
    backend.close()


@pytest.mark.parametrize(("begun_to_answer", "statuses"), [(True, [200]), (False, [503])])
def test_what_has_begun_to_be_answered_is_not_answered_twice(begun_to_answer: bool, statuses: list[int]) -> None:
    sent: list[Any] = []

    async def keep(message: Any) -> None:
        sent.append(message)

    async def nothing() -> Any:
        return {}

    async def answer(scope: Any, receive: Any, send: Any) -> None:
        if begun_to_answer:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        await asyncio.sleep(60)

    async def stopped_amid_it() -> set[Any]:
        state = SimpleNamespace(under_way=set())
        scope = {
            "type": "http",
            "method": "GET",
            "path": "/v1/loops",
            "headers": [],
            "app": SimpleNamespace(state=state),
        }
        task = asyncio.create_task(AnswerWhenStopped(answer)(scope, nothing, keep))
        await asyncio.sleep(0)
        assert state.under_way == {task}
        task.cancel()
        await task
        return state.under_way

    assert asyncio.run(stopped_amid_it()) == set()
    assert [message["status"] for message in sent if message["type"] == "http.response.start"] == statuses
