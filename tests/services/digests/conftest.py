"""A night of a plant of two units, and who gets its digest: a mail server and a web server that keep what comes."""

import asyncio
import email
import email.policy
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from email.message import EmailMessage
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from sqlalchemy import update

from app.services.auditing.audits import start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.auditing.nightly import nightly
from app.services.backend import Backend
from app.services.digests import deliveries
from app.settings import Settings
from app.storage.tables import deliveries as delivered
from app.storage.tables import verdicts
from tests.services.kept_rows import made_once

AddLoops = Callable[..., dict[str, int]]
HOSTILE = "<script>alert(1)</script>\r\nBcc: evil@example.com"
SIGNED_WITH = "a word of the plant"


@dataclass
class Mailbox:
    """A mail server that keeps what it gets, after `waits_s`; `refuses` is what it says instead."""

    port: int = 0
    waits_s: float = 0.0
    mails: list[EmailMessage] = field(default_factory=list)
    refuses: str = ""

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        if self.refuses:
            return self.refuses
        await asyncio.sleep(self.waits_s)
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
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
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

    def make() -> tuple[dict[str, int], str]:
        ids = add_loops("A1", "A2", unit="U1") | add_loops("B1", HOSTILE, unit="U2")
        first = start_audit(backend)
        audit_chunk(backend, int(first.id), "test")
        return ids, first.id

    ids, first = made_once(backend, "the night before", make)
    run = nightly(backend)
    audit_chunk(backend, int(run.id), "test")
    verdict = {"verdict": "stiction", "reliability": "reliable", "stiction_probability": 0.9}
    with backend.database.write() as connection:
        for tag in ("A1", HOSTILE):
            mine = (verdicts.c.audit_id == int(run.id), verdicts.c.loop_id == ids[tag])
            connection.execute(update(verdicts).where(*mine).values(**verdict))
        others = (verdicts.c.audit_id == int(first), verdicts.c.loop_id == ids["A1"])
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
