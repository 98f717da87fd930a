"""A broker that takes connections and never answers: whoever rings waits a moment, once."""

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.queue import Queue
from app.queue.publishing import ANSWERS_IN_S
from app.settings import Settings


@pytest.fixture
def silent() -> Iterator[str]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"redis://127.0.0.1:{server.getsockname()[1]}/0"


def test_a_request_waits_a_moment_for_it_and_the_next_ones_not_at_all(silent: str, tmp_path: Path) -> None:
    queue = Queue(Settings(data_dir=tmp_path, broker_url=silent, database_url="postgresql+psycopg:///none"))
    started = time.monotonic()
    assert not queue.read_upload(1)
    first = time.monotonic()
    assert first - started < 3 * ANSWERS_IN_S
    assert not queue.audit_chunks(1, 4)
    assert time.monotonic() - first < 0.1
    assert not queue.reachable()
    assert time.monotonic() - first < 3 * ANSWERS_IN_S
    queue.close()
