"""What `serve` listens on."""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.cli.serve import listen, warn_of_openness
from app.errors import RequestError
from app.services.upkeep.operations import migrate
from app.services.upkeep.presence import LOCK, alone
from app.settings import Settings


def test_short_answers_are_sent_at_once() -> None:
    with listen("127.0.0.1", 0) as listening:
        listening.listen()
        with socket.create_connection(listening.getsockname()), listening.accept()[0] as accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.parametrize("command", [("serve", "--port", "0"), ("worker",), ("beat",)], ids=" ".join)
def test_nothing_is_restored_under_what_runs(tmp_path: Path, command: tuple[str, ...]) -> None:
    settings = Settings(data_dir=tmp_path / "data")
    migrate(settings)
    environment = {**os.environ, "LOOPAUDIT_DATA_DIR": str(settings.data_dir)}
    with subprocess.Popen([sys.executable, "-m", "app", *command], env=environment, stderr=subprocess.PIPE) as running:
        try:
            until = time.monotonic() + 30.0
            while not (settings.data_dir / LOCK).exists():
                assert time.monotonic() < until
                time.sleep(0.1)
            time.sleep(0.5)  # between making the file and locking it
            assert not is_free(settings)
        finally:
            running.terminate()
            running.communicate(timeout=60)
    assert is_free(settings)


def is_free(settings: Settings) -> bool:
    try:
        with alone(settings):
            return True
    except RequestError as error:
        assert error.code == "still_running"  # noqa: PT017 - a look, not an expectation
        return False


@pytest.mark.parametrize(
    ("host", "keys_required", "warned"),
    [("0.0.0.0", False, True), ("0.0.0.0", True, False), ("127.0.0.1", False, False), ("::", False, True)],  # noqa: S104 - what is warned of
)
def test_serving_without_keys_beyond_loopback_is_warned_of(
    capsys: pytest.CaptureFixture[str], host: str, keys_required: bool, warned: bool
) -> None:
    warn_of_openness(host, keys_required)
    told = capsys.readouterr().err
    assert bool(told) == warned
    assert not told or f"no key is asked for on {host}" in told
