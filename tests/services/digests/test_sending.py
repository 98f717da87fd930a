"""The nightly digest arrives, once a receiver; and what becomes of receivers that are away."""

import json
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest
from sqlalchemy import update

from app.services.access.trail import list_trail
from app.services.backend import Backend
from app.services.digests import deliveries, webhooks
from app.services.digests.making import digest_of
from app.services.digests.sending import NotSentError, Post, shown
from app.services.upkeep import doctor
from app.services.upkeep.sweep import sweep
from app.settings import Settings
from app.storage.deliveries import wait_s
from app.storage.tables import audits
from app.storage.tables import deliveries as delivered
from tests.services.digests.conftest import SIGNED_WITH, Mailbox, Receiver, deliver_all, let_time_pass, states
from tests.services.upkeep_plant import with_settings


def test_after_the_night_it_goes_to_every_receiver_once(
    backend: Backend, night: str, mailbox: Mailbox, receiver: Receiver
) -> None:
    sweep(backend)
    sweep(backend)
    deliver_all(backend)
    sweep(backend)
    deliver_all(backend)
    assert states(backend, night) == {"mailto": ("done", 1), "http": ("done", 1)}
    (mail,) = mailbox.mails
    assert mail["Subject"].startswith("North: 2 valves stick")
    plain, html = mail.get_body(("plain",)), mail.get_body(("html",))
    assert plain is not None
    assert "WHAT CHANGED SINCE THE RUN BEFORE" in plain.get_content()
    assert html is not None
    assert "https://loops.example/loops/A1" in html.get_content()
    ((heads, body),) = receiver.posts
    told = json.loads(body)
    assert told["id"] == heads["webhook-id"]
    assert told["areas"][0]["loops"][0]["loop"] == "A1"
    made = deliveries.post_of(digest_of(backend, night), backend.settings.digest_webhooks)
    assert heads["webhook-signature"] == webhooks.signature(SIGNED_WITH, made, int(heads["webhook-timestamp"]))
    sent = list_trail(backend, action=deliveries.ACTION).rows
    assert len(sent) == 2
    assert "hidden" not in repr(sent)


def test_the_signature_is_that_of_the_published_example() -> None:
    # https://github.com/standard-webhooks/standard-webhooks/blob/main/libraries/python/tests/test_webhooks.py
    made = Post("msg_p5jXN8AQM9LWM0D4loKWxJek", b'{"test": 2432232314}')
    signed = webhooks.signature("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", made, 1614265330)
    assert signed == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="


def test_sent_but_not_marked_is_sent_again_with_the_same_id(
    backend: Backend, night: str, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        """As SIGKILL: nothing after it runs."""

    def die(*_: object) -> None:
        raise Killed

    sweep(backend)
    with monkeypatch.context() as dying:
        dying.setattr(deliveries, "_sent", die)
        with pytest.raises(Killed):
            deliver_all(backend)
        with pytest.raises(Killed):
            deliver_all(backend)
    assert {state for state, _ in states(backend, night).values()} == {"claimed"}
    let_time_pass(backend)
    sweep(backend)
    deliver_all(backend)
    assert {state for state, _ in states(backend, night).values()} == {"done"}
    assert len(receiver.posts) == 2
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 1
    assert len({body for _, body in receiver.posts}) == 1


@pytest.mark.parametrize("final", [True, False])
def test_who_lost_the_lease_tells_nothing_of_what_another_has_delivered(
    backend: Backend,
    night: str,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    final: bool,
) -> None:
    alone = with_settings(backend, digest_webhooks="")
    own = deliveries._send

    def overtaken(*arguments: Any) -> None:
        monkeypatch.setattr(deliveries, "_send", own)
        let_time_pass(alone)
        sweep(alone)
        assert deliveries.deliver_next(alone, "another")
        raise NotSentError("the receiver answered 404", final=final)

    sweep(alone)
    monkeypatch.setattr(deliveries, "_send", overtaken)
    assert deliveries.deliver_next(alone, "the first")
    assert states(alone, night) == {"mailto": ("done", 2)}
    assert [row.outcome for row in list_trail(alone, action=deliveries.ACTION).rows] == ["done"]
    assert "answered 404" not in repr([vars(record) for record in caplog.records])


def test_a_mail_server_that_takes_its_time_gets_it_once(backend: Backend, night: str, mailbox: Mailbox) -> None:
    """Longer than a lease: another worker would send it again meanwhile, and one more after that."""
    short = with_settings(backend, lease_s=3.0, digest_webhooks="")
    mailbox.waits_s = 6.0
    sweep(short)
    with ThreadPoolExecutor(1) as worker:
        sending = worker.submit(deliveries.deliver_next, short, "slow")
        time.sleep(0.2)
        while not sending.done():
            sweep(short)
            assert not deliveries.deliver_next(short, "quick")
            time.sleep(0.1)
        assert sending.result()
    assert len(mailbox.mails) == 1
    assert states(short, night) == {"mailto": ("done", 1)}


def test_a_receiver_that_fails_is_tried_later_and_in_the_end_given_up(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox
) -> None:
    receiver.answers, mailbox.refuses = 500, "451 come again"
    sweep(backend)
    deliver_all(backend)
    assert states(backend, night) == {"mailto": ("open", 1), "http": ("open", 1)}
    deliver_all(backend)
    assert len(receiver.posts) == 1  # not at once
    mailbox.refuses = ""
    for _ in range(backend.settings.digest_attempts):
        let_time_pass(backend)
        deliver_all(backend)
    assert states(backend, night) == {"mailto": ("done", 2), "http": ("failed", backend.settings.digest_attempts)}
    (given_up,) = [one for one in deliveries.deliveries_of(backend, night) if one.state == "failed"]
    assert given_up.reason == "the receiver answered 500"
    assert deliveries.newest_failed(backend) == [given_up]
    assert "the receiver answered 500" in doctor.digests(backend).found
    assert sweep(backend).nightly is None  # the audits go on


def test_what_is_to_be_tried_again_does_not_wait_for_a_clock_that_was_put_back(
    backend: Backend, night: str, receiver: Receiver
) -> None:
    receiver.answers = 500
    sweep(backend)
    deliver_all(backend)
    receiver.answers = 204
    with backend.database.write() as connection:  # seen from an hour before, what is to come lies an hour further off
        connection.execute(update(delivered).values(next_try_s=delivered.c.next_try_s + 3600.0))
    sweep(backend)
    deliver_all(backend)
    assert states(backend, night)["http"] == ("done", 2)


@pytest.mark.parametrize(("status", "said"), [(302, "redirects are not followed"), (404, "answered 404")])
def test_what_will_not_change_is_not_tried_again(
    backend: Backend, night: str, receiver: Receiver, status: int, said: str
) -> None:
    receiver.answers = status
    sweep(backend)
    deliver_all(backend)
    assert states(backend, night)["http"] == ("failed", 1)
    assert len(receiver.posts) == 1
    assert said in str(deliveries.newest_failed(backend)[0].reason)


def test_waits_double_up_to_an_hour() -> None:
    assert [wait_s(attempt) for attempt in (1, 2, 3, 7, 20)] == [60, 120, 240, 3600, 3600]


@pytest.mark.parametrize(
    "address",
    [
        *("http://127.0.0.1/", "http://localhost/", "http://[::1]/", "http://[::ffff:127.0.0.1]/", "http://0.0.0.0/"),
        *("http://10.1.2.3/", "http://192.168.1.1/", "http://172.16.0.1/", "http://169.254.169.254/latest/meta-data"),
        *(
            "http://2130706433/",
            "http://[fe80::1]/",
            "http://100.64.0.1/",
            "http://224.0.0.1/",
            "http://[64:ff9b::7f00:1]/",
            "http://[fec0::1]/",
            "http://[::7f00:1]/",
        ),
    ],
)
def test_private_addresses_are_refused_after_they_are_resolved(address: str) -> None:
    with pytest.raises(NotSentError, match="private or special"):
        webhooks.checked_address(httpx.URL(address), private=False)


def test_a_name_that_leads_inside_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def resolved(*_: object, **__: object) -> list[Any]:
        return [(2, 1, 6, "", ("93.184.216.34", 443)), (2, 1, 6, "", ("10.0.0.1", 443))]

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    with pytest.raises(NotSentError, match="private or special"):
        webhooks.checked_address(httpx.URL("https://hooks.example/"), private=False)


def test_of_a_webhook_only_its_server_is_shown() -> None:
    assert shown("https://user:pass@hooks.example:8443/T0/secret?token=1") == "https://hooks.example:8443/..."


@pytest.mark.parametrize(
    "wrong",
    [
        {"digest_mail_to": "a@b\nBcc: c@d"},
        {"digest_mail_to": "nobody"},
        {"digest_mail_from": "a b@c"},
        {"digest_webhooks": "ftp://x"},
        {"public_url": "javascript:alert(1)"},
    ],
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, str]) -> None:
    with pytest.raises(ValueError, match=r"must begin|not an address"):
        Settings(**wrong)


def test_a_night_of_long_ago_is_not_told_of(backend: Backend, night: str, receiver: Receiver) -> None:
    with backend.database.write() as connection:
        connection.execute(update(audits).values(ended_at=datetime(2026, 1, 1, tzinfo=UTC)))
    sweep(backend)
    deliver_all(backend)
    assert receiver.posts == []
    assert deliveries.deliveries_of(backend, night) == []
