"""The nightly digest: what it says, that it arrives, once a receiver, and what becomes of receivers that are away."""

import email
import email.policy
import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from email.message import EmailMessage
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import httpx
import pytest
from aiosmtpd.controller import Controller
from sqlalchemy import update
from typer.main import get_command
from typer.testing import CliRunner

from app.cli.digest import sent
from app.cli.main import cli
from app.cli.messages import ExitCode
from app.errors import RequestError
from app.services.access.trail import list_trail
from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.digests import deliveries, mailing, webhooks
from app.services.digests.digest import Digest, as_html, as_text, digest_of, newest_run, subject
from app.services.digests.sending import NotSentError, shown
from app.services.upkeep import doctor
from app.services.upkeep.operations import sweep
from app.settings import Settings
from app.storage.tables import audits, verdicts
from app.storage.tables import deliveries as delivered

AddLoops = Callable[..., dict[str, int]]
HOSTILE = "<script>alert(1)</script>\r\nBcc: evil@example.com"
SIGNED_WITH = "a word of the plant"


@dataclass
class Mailbox:
    """A mail server that keeps what it gets; `refuses` is what it says instead."""

    port: int = 0
    mails: list[EmailMessage] = field(default_factory=list)
    refuses: str = ""

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        if self.refuses:
            return self.refuses
        self.mails.append(email.message_from_bytes(envelope.content, policy=email.policy.default))
        return "250 OK"


@dataclass
class Receiver:
    """A web server that keeps what is posted; `answers` is its status."""

    port: int = 0
    posts: list[tuple[dict[str, str], bytes]] = field(default_factory=list)
    answers: int = 204


@pytest.fixture
def mailbox() -> Iterator[Mailbox]:
    found = Mailbox()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        found.port = probe.getsockname()[1]
    controller = Controller(found, hostname="127.0.0.1", port=found.port)
    controller.start()
    yield found
    controller.stop()


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    found = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            found.posts.append(({name.lower(): value for name, value in self.headers.items()}, body))
            self.send_response(found.answers)
            self.send_header("Location", f"http://127.0.0.1:{found.port}/elsewhere")
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Nothing on stderr."""

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        found.port = server.server_port
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield found
        server.shutdown()
        thread.join()


@pytest.fixture
def settings(settings: Settings, mailbox: Mailbox, receiver: Receiver) -> Settings:
    return settings.model_copy(
        update={
            "plant": "North",
            "public_url": "https://loops.example",
            "digest_mail_to": "you@example.com",
            "digest_mail_from": "loopaudit@example.com",
            "digest_smtp_host": "127.0.0.1",
            "digest_smtp_port": mailbox.port,
            "digest_smtp_starttls": False,
            "digest_webhooks": f"http://127.0.0.1:{receiver.port}/hook?token=hidden",
            "digest_webhook_secret": Settings(digest_webhook_secret=SIGNED_WITH).digest_webhook_secret,
            "digest_private_webhooks": True,
        }
    )


@pytest.fixture
def night(backend: Backend, add_loops: AddLoops) -> str:
    """The second night of a plant of two units; a valve of U1 has begun to stick."""
    ids = add_loops("A1", "A2", unit="U1") | add_loops("B1", HOSTILE, unit="U2")
    first = start_audit(backend)
    audit_chunk(backend, int(first.id), "test")
    run = nightly(backend)
    audit_chunk(backend, int(run.id), "test")
    verdict = {"verdict": "stiction", "reliability": "reliable", "stiction_probability": 0.9}
    with backend.database.write() as connection:
        for tag in ("A1", HOSTILE):
            mine = (verdicts.c.audit_id == int(run.id), verdicts.c.loop_id == ids[tag])
            connection.execute(update(verdicts).where(*mine).values(**verdict))
        others = (verdicts.c.audit_id == int(first.id), verdicts.c.loop_id == ids["A1"])
        connection.execute(update(verdicts).where(*others).values(verdict="no_stiction"))
    return run.id


def states(backend: Backend, run: str) -> dict[str, tuple[str, int]]:
    return {one.receiver.partition(":")[0]: (one.state, one.attempts) for one in deliveries.deliveries_of(backend, run)}


def deliver_all(backend: Backend) -> None:
    while deliveries.deliver_next(backend, "test"):
        pass


def let_time_pass(backend: Backend) -> None:
    """As if leases and waits were over."""
    with backend.database.write() as connection:
        connection.execute(update(delivered).values(lease_until_s=1.0, next_try_s=1.0))


def test_it_tells_the_worst_of_each_unit_and_what_changed(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    assert [(area.unit, area.loops[0].loop) for area in found.areas] == [("U1", "A1"), ("U2", HOSTILE)]
    change = next(change for change in found.changes if change.loop == "A1")
    assert (change.kind, change.before) == ("new", "no_stiction")
    text = as_text(found)
    assert "1. A1: valve sticks (probability 0.90, rely on it)" in text
    assert "A1: newly said to stick (no stiction -> valve sticks)" in text
    assert "https://loops.example/loops/A1" in text
    assert subject(found).startswith("North: 2 valves stick, ")


def test_it_names_the_loops_that_were_not_auditable(backend: Backend, night: str, add_loops: AddLoops) -> None:
    refused = {"verdict": "not_auditable", "likely_cause": "stuck_valve_or_dead_transmitter"}
    named = ["A2", "B1"]
    ids = add_loops(*named)
    with backend.database.write() as connection:
        mine = (verdicts.c.audit_id == int(night), verdicts.c.loop_id.in_(ids.values()))
        connection.execute(update(verdicts).where(*mine).values(**refused))
    told = "2 not auditable: PV never moves: stuck valve or dead transmitter (A2, B1)"
    found = digest_of(backend, night)
    assert found.refused_loops == {"stuck_valve_or_dead_transmitter": named}
    assert told in as_text(found)
    assert told in as_html(found)


def test_a_later_run_changes_nothing_of_it(backend: Backend, night: str) -> None:
    before = digest_of(backend, night)
    audit_chunk(backend, int(start_audit(backend).id), "test")
    assert digest_of(backend, night) == before
    assert newest_run(backend) == night


def test_what_a_plant_is_called_stays_text(backend: Backend, night: str) -> None:
    found = digest_of(backend, night)
    assert "<script>" not in as_html(found)
    assert "&lt;script&gt;" in as_html(found)
    hostile = Digest(**(vars(found) | {"plant": HOSTILE}))
    mail = mailing.message(backend.settings, deliveries.outgoing(hostile, "mailto:you@example.com"), "you@example.com")
    head = mail.as_bytes().partition(b"\r\n\r\n")[0]
    assert b"\nBcc" not in head
    assert mail["To"] == "you@example.com"
    assert not [line for line in as_text(hostile).splitlines() if line.startswith("Bcc")]


def test_a_run_that_goes_on_has_none(backend: Backend, add_loops: AddLoops) -> None:
    with pytest.raises(RequestError, match="no audit has ended"):
        newest_run(backend)
    add_loops("A")
    with pytest.raises(RequestError, match="has not ended"):
        digest_of(backend, start_audit(backend).id)


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
    assert "WORST OF U1" in plain.get_content()
    assert html is not None
    assert "https://loops.example/loops/A1" in html.get_content()
    ((heads, body),) = receiver.posts
    told = json.loads(body)
    assert told["id"] == heads["webhook-id"]
    assert told["areas"][0]["loops"][0]["loop"] == "A1"
    made = deliveries.outgoing(digest_of(backend, night), backend.settings.digest_webhooks)
    assert heads["webhook-signature"] == webhooks.signature(SIGNED_WITH, made, int(heads["webhook-timestamp"]))
    sent = list_trail(backend, action=deliveries.ACTION).rows
    assert len(sent) == 2
    assert "hidden" not in repr(sent)


def test_the_signature_is_that_of_the_published_example() -> None:
    # https://github.com/standard-webhooks/standard-webhooks/blob/main/libraries/python/tests/test_webhooks.py
    made = deliveries.Outgoing("msg_p5jXN8AQM9LWM0D4loKWxJek", "", "", "", b'{"test": 2432232314}')
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


def test_what_was_given_up_is_sent_by_hand_once_its_reason_is_mended(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, capsys: pytest.CaptureFixture[str]
) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    assert f"`loopaudit digest --send --audit {night}`" in doctor.digests(backend).advice
    assert sent(backend, night) is ExitCode.SOME_FAILED
    receiver.answers = 204
    assert sent(backend, night) is ExitCode.DONE
    assert states(backend, night) == {"mailto": ("done", 1), "http": ("done", 1)}
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 1
    assert len(mailbox.mails) == 1
    assert doctor.digests(backend).state == "ok"
    told = capsys.readouterr().out
    assert "the receiver answered 404" in told
    assert "mailto:you@example.com: already delivered at 20" in told


def test_what_is_taken_up_by_hand_has_all_its_tries_again(backend: Backend, night: str, receiver: Receiver) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    receiver.answers = 500
    assert sent(backend, night) is ExitCode.SOME_FAILED
    assert states(backend, night)["http"] == ("open", 1)


def test_who_has_it_gets_it_again_where_that_is_wanted(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, capsys: pytest.CaptureFixture[str]
) -> None:
    assert sent(backend, night) is ExitCode.DONE
    assert sent(backend, night) is ExitCode.DONE
    assert (len(mailbox.mails), len(receiver.posts)) == (1, 1)
    assert capsys.readouterr().out.count("already delivered at ") == 2
    assert sent(backend, night, again=True) is ExitCode.DONE
    assert "already" not in capsys.readouterr().out
    # Mail servers and careful receivers drop what they know by its id.
    assert len({mail["Message-ID"] for mail in mailbox.mails}) == 2
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 2
    assert {json.loads(body)["id"] for _, body in receiver.posts} == {
        heads["webhook-id"] for heads, _ in receiver.posts
    }


def test_what_is_sent_once_more_keeps_its_new_id_at_every_try(backend: Backend, night: str, receiver: Receiver) -> None:
    assert sent(backend, night) is ExitCode.DONE
    receiver.answers = 500
    assert sent(backend, night, again=True) is ExitCode.SOME_FAILED
    receiver.answers = 404
    let_time_pass(backend)
    deliver_all(backend)  # by the service
    assert states(backend, night)["http"] == ("failed", 2)
    receiver.answers = 204
    assert sent(backend, night) is ExitCode.DONE
    first, *later = [heads["webhook-id"] for heads, _ in receiver.posts]
    assert (len(later), len({*later})) == (3, 1)
    assert later[0].startswith(f"{first}-")


def test_a_worker_that_is_faster_than_the_command_sends_with_the_new_id_too(
    backend: Backend, night: str, receiver: Receiver, mailbox: Mailbox, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert sent(backend, night) is ExitCode.DONE
    own = deliveries.deliver_next

    def overtaken(*arguments: Any) -> bool:
        while own(backend, "a worker"):
            pass
        return own(*arguments)

    with monkeypatch.context() as busy:
        busy.setattr(deliveries, "deliver_next", overtaken)
        assert sent(backend, night, again=True) is ExitCode.DONE
    assert (len(mailbox.mails), len(receiver.posts)) == (2, 2)
    assert len({mail["Message-ID"] for mail in mailbox.mails}) == 2
    assert len({heads["webhook-id"] for heads, _ in receiver.posts}) == 2


def test_a_dry_run_sends_nothing_again(
    backend: Backend, night: str, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def same() -> Iterator[Backend]:
        yield backend

    def done(*options: str) -> int:
        return CliRunner().invoke(cli, ["digest", *options]).exit_code

    monkeypatch.setattr("app.cli.digest.opened", same)
    refused = CliRunner().invoke(cli, ["digest", "--dry-run", "--again"]).exception
    assert isinstance(refused, RequestError)  # exit code 2, of `main`
    assert refused.code == "dry_run_sends"
    assert (done("--dry-run"), done()) == (0, 0)
    assert receiver.posts == []
    assert (done("--send"), done("--again"), done("--again", "--send")) == (0, 0, 0)
    assert len(receiver.posts) == 3


def test_who_stands_no_longer_in_the_settings_is_not_complained_of(
    backend: Backend, night: str, receiver: Receiver
) -> None:
    receiver.answers = 404
    sweep(backend)
    deliver_all(backend)
    fewer = Backend(backend.settings.model_copy(update={"digest_webhooks": ""}), backend.database, backend.queue)
    assert doctor.digests(fewer).state == "ok"
    assert sent(fewer, night) is ExitCode.DONE


def test_without_a_night_the_digest_is_that_of_a_run_of_the_plant(backend: Backend, add_loops: AddLoops) -> None:
    add_loops("A", "B")
    run = start_audit(backend)
    audit_chunk(backend, int(run.id), "test")
    assert newest_run(backend) == run.id
    (said,) = [option.help for option in get_command(cli).commands["digest"].params if option.name == "audit"]
    assert "where no night began within the day before" in said


def test_a_night_within_the_day_before_is_told_of_by_when_it_began(backend: Backend, night: str) -> None:
    asked_for = start_audit(backend).id
    audit_chunk(backend, int(asked_for), "test")
    with backend.database.write() as connection:
        began = update(audits).where(audits.c.id == int(night))
        connection.execute(began.values(created_at=datetime.now(UTC) - timedelta(hours=23)))
        assert newest_run(backend) == night
        connection.execute(began.values(created_at=datetime.now(UTC) - timedelta(hours=25)))
    assert newest_run(backend) == asked_for  # the night has ended just now


def test_waits_double_up_to_an_hour() -> None:
    assert [deliveries.wait_s(attempt) for attempt in (1, 2, 3, 7, 20)] == [60, 120, 240, 3600, 3600]


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


def test_the_doctor_says_what_is_missing(backend: Backend) -> None:
    assert doctor.digests(backend).state == "ok"
    bare = Settings(data_dir=backend.settings.data_dir, digest_mail_to="a@b", digest_webhooks="https://x.example/")
    found = doctor.digests(Backend(bare, backend.database, backend.queue))
    assert found.state == "problem"
    for name in ("SMTP_HOST", "MAIL_FROM", "WEBHOOK_SECRET"):
        assert f"LOOPAUDIT_DIGEST_{name}" in found.found


def test_the_doctor_warns_of_a_name_that_leads_inside_or_nowhere(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    def resolved(host: str, *_: object, **__: object) -> list[Any]:
        if host == "nowhere.example":
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return [(2, 1, 6, "", ("10.0.0.1", 443))]

    def advised(**changed: object) -> doctor.Check:
        settings = backend.settings.model_copy(update=changed)
        return doctor.digests(Backend(settings, backend.database, backend.queue))

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    inside = {"digest_webhooks": "https://hooks.inside.example/hidden"}
    found = advised(**inside, digest_private_webhooks=False)
    assert (found.state, "hooks.inside.example is a private" in found.found) == ("warning", True)
    assert advised(**inside, digest_private_webhooks=True).state == "ok"
    lost = advised(digest_webhooks="https://nowhere.example/hidden")
    assert (lost.state, lost.found) == (
        "warning",
        "https://nowhere.example/... is not found: Name or service not known",
    )
    assert "mail server nowhere.example is not found" in advised(digest_smtp_host="nowhere.example").found


@pytest.mark.parametrize("label", ["", "a" * 64])
def test_a_name_that_cannot_be_looked_up_is_told_and_not_raised(backend: Backend, night: str, label: str) -> None:
    """Settings refuse it now."""
    host = f"mail.{label}.example.com"
    wrong = {"digest_smtp_host": host, "digest_webhooks": f"https://{host}/hidden"}
    lost = Backend(backend.settings.model_copy(update=wrong), backend.database, backend.queue)
    told = list(deliveries.out_of_reach(lost))
    assert told == [
        f"the mail server {host} is not found: this is no name",
        f"https://{host}/... is not found: this is no name",
    ]
    assert doctor.digests(lost).state == "warning"
    assert sent(lost, night) is ExitCode.SOME_FAILED
    reasons = {str(one.reason) for one in deliveries.deliveries_of(lost, night)}
    assert reasons == {
        f"the mail server {host} has a name that is none",
        "the receiver cannot be reached: UnicodeError",
    }


def test_a_webhook_that_may_not_go_inside_is_a_problem_and_given_up(backend: Backend, night: str) -> None:
    """The service starts all the same."""
    kept_out = backend.settings.model_copy(update={"digest_private_webhooks": False, "digest_mail_to": ""})
    inside = Backend(kept_out, backend.database, backend.queue)
    found = doctor.digests(inside)
    assert (found.state, found.advice) == ("problem", "LOOPAUDIT_DIGEST_PRIVATE_WEBHOOKS=true allows these")
    assert "no webhook goes to 127.0.0.1" in found.found
    sweep(inside)
    deliver_all(inside)
    assert states(inside, night)["http"] == ("failed", 1)


@pytest.mark.parametrize(
    ("secret", "key", "state"),
    [
        ("whsec_" + "AAEC" * 8, bytes([0, 1, 2]) * 8, "ok"),
        ("whsec_-_8=", b"whsec_-_8=", "warning"),  # url-safe
        ("whsec_AAECAw", b"whsec_AAECAw", "warning"),  # without its padding
        ("whsec_a word", b"whsec_a word", "warning"),
        ("whsec_Schl\u00fcssel", "whsec_Schl\u00fcssel".encode(), "warning"),
        ("a word", b"a word", "ok"),
    ],
)
def test_a_secret_signs_as_it_always_did_and_the_doctor_tells_how(
    backend: Backend, secret: str, key: bytes, state: str
) -> None:
    assert webhooks.key_of(secret) == key
    changed = {"digest_webhook_secret": Settings(digest_webhook_secret=secret).digest_webhook_secret}
    found = doctor.digests(Backend(backend.settings.model_copy(update=changed), backend.database, backend.queue))
    assert found.state == state
    assert secret not in repr(found)


def test_a_night_of_long_ago_is_not_told_of(backend: Backend, night: str, receiver: Receiver) -> None:
    with backend.database.write() as connection:
        connection.execute(update(audits).values(ended_at=datetime(2026, 1, 1, tzinfo=UTC)))
    sweep(backend)
    deliver_all(backend)
    assert receiver.posts == []
    assert deliveries.deliveries_of(backend, night) == []
