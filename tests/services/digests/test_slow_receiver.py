"""A webhook that answers byte by byte, each in time: it is away like one that says nothing."""

import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from app.services.digests import webhooks
from app.services.digests.sending import NotSentError, Post
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
