"""The rules by which requests are let in, each by itself: who needs a key, who waits, and what a refusal asks for."""

import asyncio
import logging
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy.exc import OperationalError
from starlette.datastructures import Headers

from app.http.asked import Asked
from app.http.callers import Callers, looked_up, unauthorized
from app.http.guard import Guard, permit
from app.http.permissions import OPEN_PAGE, PAGE, READ, Permission
from app.http.problems import Refusal
from app.services.access.identity import ANYONE, Identity
from app.settings import Settings


def service(**state: Any) -> Any:
    return SimpleNamespace(state=SimpleNamespace(**{"rates": None, **state}))


GOOD, NEW = "was good before", "is not known yet"


@pytest.mark.parametrize(("refused_s", "secret", "waits"), [(9, GOOD, False), (9, NEW, True), (0, NEW, False)])
def test_good_keys_behind_a_proxy_do_not_wait_for_the_wrong_ones(refused_s: int, secret: str, waits: bool) -> None:
    async def asked_while_another_is_looked_up() -> Identity | None:
        access = SimpleNamespace(was_good=lambda it, via: it == GOOD, key=lambda it: ANYONE)
        rates = SimpleNamespace(refused_s=lambda address, via: refused_s)
        of = service(access=access, rates=rates, one_by_one=asyncio.Lock())
        async with of.state.one_by_one:
            asking = asyncio.create_task(looked_up(of, secret, "key", "192.0.2.1"))
            done, _ = await asyncio.wait([asking], timeout=0.05 if waits else 10)
            assert bool(done) is not waits
        return await asking

    assert asyncio.run(asked_while_another_is_looked_up()) is ANYONE


@pytest.mark.parametrize(("code", "error"), [("key_needed", ""), ("invalid_key", ', error="invalid_token"')])
def test_only_a_key_that_was_sent_is_said_to_be_wrong(code: str, error: str) -> None:
    assert unauthorized("", code).headers == {"WWW-Authenticate": f'Bearer realm="loopaudit"{error}'}


def asked_by(method: str, permission: Permission, **headers: str) -> Asked:
    return Asked({"type": "http", "method": method, "path": "/loops"}, Headers(headers), permission)


@pytest.mark.parametrize(
    ("said", "server", "forwarded", "closed"),
    [
        ({}, "127.0.0.1", False, False),
        ({}, "127.0.0.1", True, True),
        ({}, "192.0.2.7", False, True),
        ({}, None, False, True),
        ({"require_keys": True}, "127.0.0.1", False, True),
        ({"allow_open": True}, "192.0.2.7", False, False),
        ({"allow_open": True}, "127.0.0.1", True, False),
    ],
)
def test_a_key_is_asked_for_off_loopback_behind_a_proxy_and_where_that_is_set(
    said: dict[str, bool], server: str | None, forwarded: bool, closed: bool
) -> None:
    guard = Guard(lambda *_: None, of=service(), settings=Settings(**said), keys_required=None)
    headers = Headers({"X-Forwarded-For": "192.0.2.9"} if forwarded else {})
    assert guard._closed({"type": "http", "server": server and (server, 80)}, headers) is closed


@pytest.mark.parametrize(
    ("method", "permission", "status"), [("GET", PAGE, 303), ("POST", PAGE, 401), ("GET", READ, 401)]
)
def test_who_looks_at_a_page_is_led_to_the_login_and_who_sends_something_is_told(
    method: str, permission: Permission, status: int
) -> None:
    """The login leads back to an address, without what was sent there."""
    with pytest.raises(Refusal) as refused:
        permit(asked_by(method, permission), None)
    assert refused.value.status == status


def test_a_page_that_is_open_is_shown_whatever_key_is_sent() -> None:
    access = SimpleNamespace(remembered=lambda it: None, was_good=lambda it, via: True, key=lambda it: None)
    callers = Callers(service(access=access))
    asked = asked_by("GET", OPEN_PAGE, authorization="Bearer of nobody")
    assert asyncio.run(callers.identified(asked, closed=True)) is None


def test_that_the_use_of_a_key_was_not_noted_is_told_in_a_line(caplog: pytest.LogCaptureFixture) -> None:
    def away(_: int) -> None:
        raise OperationalError("UPDATE keys", None, Exception("gone"))

    asyncio.run(Callers(service(access=SimpleNamespace(note_use=away)))._note_use(1))
    (told,) = (record for record in caplog.records if record.name == "loopaudit.access")
    assert told.getMessage() == "the last use of a key could not be noted: OperationalError"
    assert (told.levelno, told.exc_info) == (logging.WARNING, None)
