"""A receiver that answers byte by byte, each in time: it is away like one that says nothing."""

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from app.services.digests import mailing, webhooks
from app.services.digests.sending import Mail, NotSentError, Post
from app.settings import Settings


def test_a_receiver_that_answers_byte_by_byte_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(webhooks, "WHOLE_S", 1.0)
    settings = Settings(data_dir=tmp_path, digest_private_webhooks=True, digest_webhook_secret="any")  # noqa: S106 - no secret
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def drip() -> None:
            with suppress(OSError), listening.accept()[0] as receiver:
                receiver.sendall(b"HTTP/1.1 200 OK\r\nX-A: ")
                for _ in range(600):
                    time.sleep(0.05)
                    receiver.sendall(b"a")

        threading.Thread(target=drip, daemon=True).start()
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/hook"
        with pytest.raises(NotSentError, match="cannot be reached: TimeoutError") as refused:
            webhooks.send_webhook(settings, Post("digest-1", b"{}"), address)
    assert not refused.value.final


GREETING, HELLO, TAKEN = b"220 mail.example ESMTP\r\n", b"250 mail.example\r\n", b"250 OK\r\n"
DONE = b"250 queued\r\n"
ENCRYPTS = b"250-mail.example\r\n250 STARTTLS\r\n"
OUTGOING = Mail("7", "Night of 1 March", "2 valves stick", "<p>2 valves stick</p>")


def drip(listening: socket.socket, answers: list[bytes], word: bytes) -> None:
    """Gives a client these answers, each to a line of its own or to the end of a mail; and then this word, for long."""
    with suppress(OSError), listening.accept()[0] as client, client.makefile("rb") as lines:
        for answer in answers:
            line = b"" if answer == GREETING else lines.readline()
            while answer == DONE and line != b".\r\n":
                line = lines.readline()
            client.sendall(answer)
        for _ in range(600):
            client.sendall(word)
            time.sleep(0.05)


@pytest.mark.parametrize(
    ("answers", "word"),
    [
        ([], b"2"),
        ([GREETING], b"250-X\r\n"),
        ([GREETING, HELLO, TAKEN, TAKEN], b"3"),
        ([GREETING, ENCRYPTS, b"220 go on\r\n"], b"\x16\x03\x03\x40\x00"),
    ],
)
def test_a_mail_server_that_answers_byte_by_byte_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answers: list[bytes], word: bytes
) -> None:
    monkeypatch.setattr(mailing, "WHOLE_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=drip, args=(listening, answers, word), daemon=True).start()
        with pytest.raises(NotSentError, match=r"did not take the mail within 0\.5 s") as refused:
            mailing.send_mail(to(listening, tmp_path, ENCRYPTS in answers), OUTGOING, "you@example.com")
    assert not refused.value.final


@pytest.mark.parametrize("leave", [b"2", b"500 what?\r\n"])
def test_a_mail_that_was_taken_is_sent_however_the_server_takes_leave(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, leave: bytes
) -> None:
    monkeypatch.setattr(mailing, "WHOLE_S", 0.5)
    told = [GREETING, HELLO, TAKEN, TAKEN, b"354 go on\r\n", DONE]
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=drip, args=(listening, told, leave), daemon=True).start()
        mailing.send_mail(to(listening, tmp_path), OUTGOING, "you@example.com")


@pytest.mark.parametrize("then", [[], [TAKEN]], ids=["taking it back", "taking leave"])
def test_a_refusal_for_good_stays_one_however_slowly_the_server_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, then: list[bytes]
) -> None:
    monkeypatch.setattr(mailing, "WHOLE_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        told = [GREETING, HELLO, TAKEN, b"550 nobody here\r\n", *then]
        threading.Thread(target=drip, args=(listening, told, b"2"), daemon=True).start()
        with pytest.raises(NotSentError, match=r"refused you@example\.com: 550 nobody here") as refused:
            mailing.send_mail(to(listening, tmp_path), OUTGOING, "you@example.com")
    assert refused.value.final


def test_a_mail_server_of_many_addresses_of_which_none_answers_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[object] = []

    class Silent(socket.socket):
        def connect(self, address: object) -> None:
            tried.append(address)
            time.sleep(self.gettimeout() or 0.0)
            raise TimeoutError("timed out")

    place = (socket.AF_INET, socket.SOCK_STREAM, 6, "")
    many: list[tuple[object, ...]] = [(*place, (f"192.0.2.{n}", 25)) for n in range(40)]

    def look_up(host: str, *_: object, **__: object) -> list[tuple[object, ...]]:
        return many if host == "mail.example" else [(*place, (host, 25))]

    monkeypatch.setattr(socket, "socket", Silent)
    monkeypatch.setattr(socket, "getaddrinfo", look_up)
    monkeypatch.setattr(mailing, "TIMEOUT_S", 0.2)
    monkeypatch.setattr(mailing, "WHOLE_S", 0.5)
    settings = Settings(data_dir=tmp_path, digest_mail_from="loopaudit@example.com", digest_smtp_host="mail.example")
    with pytest.raises(NotSentError, match="cannot be used: TimeoutError"):
        mailing.send_mail(settings, OUTGOING, "you@example.com")
    assert 1 <= len(tried) <= 3


def to(listening: socket.socket, tmp_path: Path, encrypted: bool = False) -> Settings:
    port = listening.getsockname()[1]
    where = {"digest_smtp_host": "127.0.0.1", "digest_smtp_port": port, "digest_smtp_starttls": encrypted}
    return Settings(data_dir=tmp_path, digest_mail_from="loopaudit@example.com", **where)
