"""A broker that takes connections and never answers: whoever rings waits a moment, once."""

import socket
import subprocess
import sys
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


def test_what_is_wrong_with_the_address_of_a_broker_is_said_to_whoever_asks(tmp_path: Path) -> None:
    queue = Queue(Settings(data_dir=tmp_path, broker_url="redis://127.0.0.1:1/0?credential_provider=builtins.dict"))
    with pytest.raises(ValueError, match="Credential provider is not"):
        queue.reachable()
    queue.close()


NAMED_BY_NOBODY = """
import sys
import threading
from pathlib import Path
from app.queue import Queue, publishing
from app.settings import Settings

publishing.HANGS_AFTER_S = 0.1
publishing.Queue._answers = lambda queue: threading.Event().wait()
queue = Queue(Settings(data_dir=Path(sys.argv[1]), broker_url="redis://nowhere.example/0"))
print(queue.reachable(), queue.reachable(), flush=True)
queue.close()
"""


def test_a_process_ends_while_the_name_of_its_broker_is_still_looked_for(tmp_path: Path) -> None:
    command = [sys.executable, "-c", NAMED_BY_NOBODY, str(tmp_path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert (ended.returncode, ended.stdout) == (0, "False False\n"), ended.stderr
