"""The digest's mail over STARTTLS: encrypted, to a server whose certificate holds, or not at all."""

import shutil
import socket
import ssl
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult, LoginPassword

from app.services.digests.mailing import send_mail
from app.services.digests.sending import Mail, NotSentError
from app.settings import Settings

OUTGOING = Mail("7", "Night of 1 March", "2 valves stick", "<p>2 valves stick</p>")
TO = "you@example.com"
LOGIN = {"digest_smtp_user": "plant", "digest_smtp_password": "hidden"}


@dataclass
class Server:
    """What a mail server was given, and whether it came encrypted."""

    port: int
    mails: list[bytes] = field(default_factory=list)
    encrypted: list[bool] = field(default_factory=list)
    logins: list[LoginPassword] = field(default_factory=list)

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:
        self.mails.append(envelope.content)
        self.encrypted.append(session.ssl is not None)
        return "250 OK"

    def authenticate(self, server: Any, session: Any, envelope: Any, mechanism: str, data: Any) -> AuthResult:
        self.logins.append(data)
        return AuthResult(success=True)


@dataclass(frozen=True)
class Certificate:
    chain: Path
    key: Path

    def context(self) -> ssl.SSLContext:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self.chain, self.key)
        return context


Issue = Callable[[str], Certificate]


@pytest.fixture
def issue(tmp_path: Path) -> Issue:
    """Makes certificates that sign themselves, for the name that is given."""
    program = shutil.which("openssl")
    if program is None:
        pytest.skip("no openssl on this machine, to make a certificate")

    def made(subject: str) -> Certificate:
        found = Certificate(tmp_path / "server.pem", tmp_path / "server.key")
        words = ("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-subj", "/CN=mail")
        files = ("-keyout", str(found.key), "-out", str(found.chain))
        told = ("-addext", f"subjectAltName={subject}", "-days", "2")
        subprocess.run([program, *words, *files, *told], check=True, capture_output=True)
        return found

    return made


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def serving(certificate: Certificate | None) -> Iterator[Server]:
    server = Server(free_port())
    tls = {} if certificate is None else {"tls_context": certificate.context(), "require_starttls": True}
    controller = Controller(server, hostname="127.0.0.1", port=server.port, authenticator=server.authenticate, **tls)
    controller.start()
    try:
        yield server
    finally:
        controller.stop()


def settings(server: Server, **more: Any) -> Settings:
    where = {"digest_smtp_host": "127.0.0.1", "digest_smtp_port": server.port, "digest_smtp_starttls": True}
    return Settings(digest_mail_from="loopaudit@example.com", **{**where, **more})


def test_a_mail_goes_encrypted_to_a_server_whose_certificate_holds(issue: Issue, monkeypatch) -> None:
    certificate = issue("IP:127.0.0.1")
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate.chain))
    with serving(certificate) as server:
        send_mail(settings(server), OUTGOING, TO)
        send_mail(settings(server, **LOGIN), OUTGOING, TO)
    assert server.encrypted == [True, True]
    assert b"2 valves stick" in server.mails[0]
    assert server.logins == [LoginPassword(b"plant", b"hidden")]


@pytest.mark.parametrize(
    ("subject", "trusted", "words"),
    [
        ("IP:127.0.0.1", False, "self-signed certificate"),
        ("DNS:mail.example", True, "IP address mismatch"),
    ],
    ids=["signed by nobody known", "of another server"],
)
def test_a_wrong_certificate_is_refused_and_said(issue: Issue, monkeypatch, subject, trusted, words) -> None:
    certificate = issue(subject)
    if trusted:
        monkeypatch.setenv("SSL_CERT_FILE", str(certificate.chain))
    with serving(certificate) as server, pytest.raises(NotSentError) as refused:
        send_mail(settings(server, **LOGIN), OUTGOING, TO)
    assert str(refused.value).startswith("the certificate of the mail server 127.0.0.1 is refused: ")
    assert words in str(refused.value)
    assert not refused.value.final
    assert (server.mails, server.logins) == ([], [])


def test_a_server_that_does_not_encrypt_gets_nothing() -> None:
    with serving(None) as server, pytest.raises(NotSentError, match="STARTTLS"):
        send_mail(settings(server), OUTGOING, TO)
    assert server.mails == []
