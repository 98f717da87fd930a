"""Logs are structured, carry their ids, and hold nothing secret."""

import json
import logging
import time

import pytest

from app import logs
from app.services.access import key_text
from app.services.access.identity import Role

KEY = key_text.make(Role.admin).text
PASSWORD = "hunter2-" + "x" * 8


def line(as_json: bool, message: str, *arguments: object, error: BaseException | None = None, **extra: object) -> str:
    trouble = (type(error), error, error.__traceback__) if error else None
    record = logging.getLogger("loopaudit.test").makeRecord(
        "loopaudit.test", logging.WARNING, __file__, 1, message, arguments, trouble, extra=extra
    )
    return logs.formatter(as_json).format(record)


def failed(text: str) -> Exception:
    try:
        raise RuntimeError(text)
    except RuntimeError as error:
        return error


SECRETS = [
    (KEY, KEY[-49:]),
    (f"Authorization: Bearer {KEY}", KEY[-49:]),
    (f"{{'x-api-key': '{PASSWORD}'}}", PASSWORD),
    (f"postgresql+psycopg://plant:{PASSWORD}@db:5432/plant", PASSWORD),
    (f"redis://:{PASSWORD}@cache/0", PASSWORD),
    (f"password={PASSWORD} host=db", PASSWORD),
    (f"cookie: loopaudit_session={PASSWORD}; a=b", PASSWORD),
    (f"csrf_token={PASSWORD}&next=/", PASSWORD),
    (f'password="{PASSWORD}"', PASSWORD),
    (f'{{"password": "{PASSWORD}"}}', PASSWORD),
    (f'password={PASSWORD}" and a quote', PASSWORD),
    (f"password={PASSWORD}\nin two lines", PASSWORD),
]


@pytest.mark.parametrize("as_json", [True, False])
@pytest.mark.parametrize(("text", "secret"), SECRETS, ids=range(len(SECRETS)))
def test_no_secret_is_logged_wherever_it_stands(as_json, text, secret):
    lines = [
        line(as_json, text),
        line(as_json, "got %s", text),
        line(as_json, "got", value=text),
        line(as_json, "fault", error=failed(text)),
    ]
    for found in lines:
        assert secret not in found
        assert logs.HIDDEN in found
        assert not as_json or json.loads(found)["level"] == "warning"


def test_what_has_the_name_of_a_secret_is_one_however_deep_it_stands():
    told = json.loads(line(True, "got", given={"a": [{"smtp_password": PASSWORD}, b"secret=" + PASSWORD.encode()]}))
    assert told["given"] == {"a": [{"smtp_password": "***"}, "b'secret=***'"]}


@pytest.mark.parametrize("before", ["%20", "%3D", "key", "_"])
def test_a_key_is_hidden_whatever_it_stands_behind(before):
    text = f"no route GET /v1/loops/FIC101{before}la_read_abcdefghij_0123456789abcdef"
    assert "0123456789" not in logs.redacted(text) + logs.without_keys(text)


def test_a_long_text_that_begins_like_addresses_is_looked_at_once():
    text, started_s = "a." * 100_000, time.monotonic()
    assert logs.redacted(text) == text
    assert time.monotonic() - started_s < 10.0  # each beginning looked at to the end it is minutes
    assert logs.redacted(f"{text}postgresql+psycopg://me:hidden@there") == f"{text}postgresql+psycopg://me:***@there"


def test_what_is_no_secret_stays():
    text = "upload 7 of la_read_abcdefghij at http://127.0.0.1:8000/v1/uploads took 3 s; valve FIC:101@area"
    assert logs.redacted(text) == text


def test_a_line_is_one_json_object_with_its_ids():
    with logs.about(run=7, request_id="r-1"):
        found = line(True, "loop failed", loop="FIC\n101", code="no_samples")
    assert "\n" not in found
    told = json.loads(found)
    assert (told["run"], told["request_id"], told["loop"], told["code"]) == (7, "r-1", "FIC\n101", "no_samples")
    assert (told["event"], told["level"], told["logger"]) == ("loop failed", "warning", "loopaudit.test")


def test_ids_end_with_what_they_are_about():
    with logs.about(run=7):
        pass
    assert "run" not in json.loads(line(True, "later"))
