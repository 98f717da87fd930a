"""Keys: their form, how they are sent, how they end, and how often they may ask."""

import asyncio
import re
import secrets
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime, timedelta

import httpx
import pytest

from app.errors import RequestError
from app.main import create_app
from app.services.access import authentication, key_text, keys, rates
from app.services.access.authentication import Authenticator
from app.services.access.identity import Role
from app.services.access.rates import REFUSALS_PER_MINUTE, Rates
from app.services.access.trail import list_trail
from app.storage import keys as stored_keys
from app.storage import trail as stored_trail
from app.storage.types import now
from tests.api.access.conftest import bearer, logged_in


@pytest.mark.parametrize("role", Role)
def test_a_key_has_the_announced_form(role):
    made = key_text.make(role)
    assert re.fullmatch(rf"la_{role}_[a-z2-7]{{10}}_[0-9A-Za-z]{{49}}", made.text)
    assert key_text.parse(made.text) == made


def test_a_typing_error_is_told_by_the_check_sum():
    text = key_text.make(Role.read).text
    for place in range(20, len(text)):
        wrong = text[:place] + ("x" if text[place] != "x" else "y") + text[place + 1 :]
        assert key_text.parse(wrong) is None


def test_a_key_that_claims_another_role_is_no_key(client, texts):
    body = texts[Role.read].replace("la_read_", "la_admin_")[: -key_text.CRC_LENGTH]
    forged = body + key_text._crc(body)
    assert key_text.parse(forged) is not None
    assert client.get("/v1/trail", headers=bearer(forged)).json()["code"] == "invalid_key"


@pytest.mark.parametrize("header", ["Authorization", "X-API-Key"])
def test_both_headers_carry_a_key(client, texts, header):
    value = texts[Role.read] if header == "X-API-Key" else f"bearer {texts[Role.read]}"
    assert client.get("/v1/loops", headers={header: value}).status_code == 200


def test_a_key_in_an_address_is_not_looked_at(client, texts):
    assert client.get("/v1/loops", params={"key": texts[Role.read]}).status_code == 401


@pytest.mark.parametrize("key", ["la_read_x", "x" * 5000, "la_read_aaaaaaaaaa_" + "0" * 49, "ünïcödé".encode()])
def test_wrong_keys_are_401(client, key):
    value = b"Bearer " + (key if isinstance(key, bytes) else key.encode())
    answer = client.get("/v1/loops", headers={"Authorization": value})
    assert (answer.status_code, answer.json()["code"]) == (401, "invalid_key")
    assert 'error="invalid_token"' in answer.headers["www-authenticate"]


def test_only_the_hash_is_kept(backend, texts):
    with backend.database.read() as connection:
        stored = str(connection.exec_driver_sql("SELECT * FROM keys").fetchall())
    for text in texts.values():
        assert text[-49:] not in stored


def test_a_revoked_key_is_refused_at_the_next_look(client, backend):
    made = keys.create_key(backend, "leaver", Role.read, lifetime=None)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 200
    keys.revoke_key(backend, made.key.id)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 401


def test_an_expired_key_is_refused(client, backend):
    made = keys.create_key(backend, "guest", Role.read, lifetime=timedelta(seconds=-1))
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 401
    assert next(key for key in keys.list_keys(backend) if key.id == made.key.id).state == "expired"


def test_rotation_lets_both_work_for_the_overlap_and_then_the_new_one(client, backend):
    old = keys.create_key(backend, "historian", Role.upload, lifetime=timedelta(days=30), requests_per_minute=77)
    new = keys.rotate_key(backend, old.key.id, timedelta(hours=1))
    assert (new.key.role, new.key.name, new.key.requests_per_minute) == ("upload", "historian", 77)
    for text in (old.text, new.text):
        assert client.get("/v1/loops", headers=bearer(text)).status_code == 200
    last = keys.rotate_key(backend, new.key.id, timedelta(0))
    assert client.get("/v1/loops", headers=bearer(new.text)).status_code == 401
    assert client.get("/v1/loops", headers=bearer(last.text)).status_code == 200


def test_a_key_is_rotated_once_and_its_follower_lives_as_long_as_it_was_to(backend):
    """Rotated again within the overlap, its lifetime would be what the overlap left of it."""
    old = keys.create_key(backend, "historian", Role.upload, lifetime=timedelta(days=365))
    new = keys.rotate_key(backend, old.key.id, timedelta(hours=24))
    with pytest.raises(RequestError, match=f"{new.key.id} follows it; rotate that one") as refused:
        keys.rotate_key(backend, old.key.id, timedelta(hours=24))
    assert refused.value.code == "wrong_state"
    last = keys.rotate_key(backend, new.key.id, timedelta(hours=24))
    lifetime = datetime.fromisoformat(last.key.expires_at) - datetime.fromisoformat(last.key.created_at)
    assert abs(lifetime - timedelta(days=365)) < timedelta(minutes=1)
    followed = {key.id: key.followed_by for key in keys.list_keys(backend)}
    assert [followed[made.key.id] for made in (old, new, last)] == [new.key.id, last.key.id, None]


def test_the_last_use_is_noted(client, backend):
    made = keys.create_key(backend, "user", Role.read, lifetime=None)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 200

    def last_used() -> str | None:
        return next(key.last_used_at for key in keys.list_keys(backend) if key.id == made.key.id)

    for _ in range(200):
        if first := last_used():
            break
    assert first
    client.get("/v1/loops", headers=bearer(made.text))
    assert last_used() == first  # written at most once a minute


def test_a_last_use_that_a_clock_ahead_noted_gives_way(backend, monkeypatch):
    made = keys.create_key(backend, "user", Role.read, lifetime=None)
    with backend.database.write() as connection:
        key = stored_keys.by_public_id(connection, made.key.id)
    ahead = now() + timedelta(days=10)
    for moment in (ahead, now()):
        monkeypatch.setattr(stored_keys, "now", lambda moment=moment: moment)
        with backend.database.write() as connection:
            stored_keys.note_use(connection, key.id, 60.0)
    with backend.database.read() as connection:
        assert stored_keys.by_public_id(connection, made.key.id).last_used_at < ahead - timedelta(days=9)


def test_too_many_requests_of_a_key_are_429_and_only_its_own(client, backend, texts):
    made = keys.create_key(backend, "eager", Role.read, lifetime=None, requests_per_minute=5)
    statuses = [client.get("/v1/loops", headers=bearer(made.text)) for _ in range(7)]
    assert [answer.status_code for answer in statuses] == [200] * 5 + [429] * 2
    assert statuses[-1].json()["code"] == "too_many_requests"
    assert 1 <= int(statuses[-1].headers["retry-after"]) <= 60
    assert client.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200


def test_logins_count_as_requests_of_their_key(browser, backend):
    made = keys.create_key(backend, "comes and goes", Role.read, lifetime=None, requests_per_minute=3)
    answers = []
    for _ in range(5):
        answers.append(browser.post("/login", data={"key": made.text}))
        browser.cookies.clear()
    assert [answer.status_code for answer in answers] == [303] * 3 + [429] * 2
    assert "may make 3 requests a minute" in answers[-1].text
    assert 1 <= int(answers[-1].headers["retry-after"]) <= 60
    rows = list_trail(backend, 20, action="session.open").rows
    assert sum(row.who == "comes and goes" for row in rows) == 3


def test_a_wrong_login_is_looked_up_once(browser, monkeypatch):
    asked, look_up = [], Authenticator.key
    monkeypatch.setattr(Authenticator, "key", lambda access, text: asked.append(text) or look_up(access, text))
    wrong = key_text.make(Role.read).text
    assert browser.post("/login", data={"key": wrong}).status_code in (401, 429)
    assert asked == [wrong]


def test_a_right_login_is_looked_up_once(browser, texts, monkeypatch):
    asked, look_up = [], stored_keys.by_public_id
    monkeypatch.setattr(stored_keys, "by_public_id", lambda *told: asked.append(told) or look_up(*told))
    assert browser.post("/login", data={"key": texts[Role.read]}).status_code == 303
    assert len(asked) == 1


def test_a_session_is_no_key_and_a_key_no_session(serve, settings, texts):
    believing = settings.model_copy(update={"key_recheck_s": 60.0})
    with serve(create_app(believing)) as client, httpx.Client(base_url=client.base_url) as browser:
        logged_in(browser, texts[Role.read])
        token = browser.cookies["loopaudit_session"]
        browser.cookies.clear()
        assert browser.get("/v1/loops", headers=bearer(token)).status_code == 401
        assert browser.get("/v1/loops", headers={"Cookie": f"loopaudit_session={texts[Role.read]}"}).status_code == 401
        assert browser.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200


@pytest.mark.parametrize(
    ("address", "counted"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("2001:db8:1:2::3", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("unknown", "unknown"),
    ],
)
def test_addresses_of_a_network_that_somebody_has_whole_count_as_one(settings, address, counted):
    assert rates.counted_as(address) == counted
    counting = rates.Rates(settings)
    for _ in range(rates.REFUSALS_PER_MINUTE):
        assert counting.refusal_wait_s(address) == 0
    assert counting.refusal_wait_s(counted.replace("/64", "9")) > 0
    assert counting.refused_s("2001:db8:1:3::3") == 0


CHANGES = {
    "key.create": lambda backend, old: keys.create_key(backend, "another", Role.read, lifetime=None),
    "key.rotate": lambda backend, old: keys.rotate_key(backend, old, timedelta(0)),
    "key.revoke": lambda backend, old: keys.revoke_key(backend, old),
}


@pytest.mark.parametrize("action", CHANGES)
def test_what_breaks_off_leaves_no_key_and_no_row(backend, monkeypatch, action):
    """A key that nobody was told would stay active without anybody's knowing."""
    old = keys.create_key(backend, "historian", Role.upload, lifetime=None).key.id
    before = keys.list_keys(backend), list_trail(backend, 1000).rows
    add = stored_trail.add

    def breaks_off(connection, values, detail) -> None:
        add(connection, values, detail)
        if values["action"] == action:
            raise KeyboardInterrupt

    monkeypatch.setattr(stored_trail, "add", breaks_off)
    with pytest.raises(KeyboardInterrupt):
        CHANGES[action](backend, old)
    assert (keys.list_keys(backend), list_trail(backend, 1000).rows) == before


@pytest.mark.parametrize(
    "asked", [("GET", "/v1/loops", {"headers": bearer("wrong")}), ("POST", "/login", {"data": {"key": "wrong"}})]
)
def test_wrong_keys_are_counted_away_from_the_event_loop(serve, settings, monkeypatch, asked):
    """A Redis that counts for several processes may take half a second for each."""
    looped = []

    def counted(self, address: str) -> int:
        with suppress(RuntimeError):
            looped.append(asyncio.get_running_loop())
        return 7

    monkeypatch.setattr(Rates, "refusal_wait_s", counted)
    method, path, sent = asked
    with serve(create_app(settings)) as client:
        assert client.request(method, path, **sent).status_code == 429
    assert looped == []


def cookie(token: str) -> dict[str, str]:
    return {"Cookie": f"loopaudit_session={token}"}


def made_key() -> str:
    return key_text.make(Role.read).text


def made_token() -> str:
    return secrets.token_urlsafe(32)


@pytest.mark.parametrize(
    ("by", "asks", "made", "at_once", "refused"),
    [
        ("key", lambda client, key: client.get("/v1/loops", headers=bearer(key)), made_key, 12, 429),
        ("key", lambda client, key: client.post("/login", data={"key": key}), made_key, 10, 429),
        ("session", lambda client, token: client.get("/v1/loops", headers=cookie(token)), made_token, 12, 401),
    ],
    ids=["key", "login", "session"],
)
def test_secrets_of_an_address_that_sends_wrong_ones_are_looked_up_one_by_one(
    serve, settings, monkeypatch, texts, by, asks, made, at_once, refused
):
    inside, most, lock, look = [], [], threading.Lock(), getattr(Authenticator, by)

    def counted(self, text: str):
        with lock:
            inside.append(text)
            most.append(len(inside))
        time.sleep(0.02)
        with lock:
            inside.remove(text)
        return look(self, text)

    wrong = [made() for _ in range(REFUSALS_PER_MINUTE + 12)]
    with serve(create_app(settings)) as client, ThreadPoolExecutor(at_once) as pool:

        def answered(secret: str) -> int:
            return asks(client, secret).status_code

        assert {answered(secret) for secret in wrong[:REFUSALS_PER_MINUTE]} == {401}
        monkeypatch.setattr(Authenticator, by, counted)
        assert set(pool.map(answered, wrong[REFUSALS_PER_MINUTE:])) == {refused}
        assert max(most) == 1
        assert client.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200


def test_cookies_of_sessions_that_have_ended_count_as_no_wrong_keys(serve, settings):
    """Open pages go on asking with them; behind the same proxy a wrong key is still told, and kept in the trail."""
    wrong = key_text.make(Role.read).text
    with serve(create_app(settings)) as client:
        for _ in range(REFUSALS_PER_MINUTE + 2):
            assert client.get("/v1/loops", headers=cookie(secrets.token_urlsafe(32))).status_code == 401
        answer = client.get("/v1/loops", headers=bearer(wrong))
        assert (answer.status_code, answer.json()["code"]) == (401, "invalid_key")
        assert client.post("/login", data={"key": wrong}).status_code == 401


def test_wrong_keys_push_out_no_good_one(backend, texts, monkeypatch):
    monkeypatch.setattr(authentication, "LARGEST_CACHE", 3)
    access = Authenticator(backend, clock=lambda: 0.0)
    assert access.key(texts[Role.read])
    for _ in range(5):
        assert access.key(key_text.make(Role.read).text) is None
    assert access.remembered(texts[Role.read])
