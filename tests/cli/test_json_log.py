"""With LOOPAUDIT_LOG_FORMAT=json each line of what runs unattended is an object, for a collector of logs."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests import forked


def own(folder: Path, **settings: str) -> dict[str, str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
    return environment | {"LOOPAUDIT_DATA_DIR": str(folder / "data"), "LOOPAUDIT_LOG_FORMAT": "json", **settings}


def started(folder: Path, *command: str, **settings: str) -> subprocess.Popen[str]:
    with (folder / "log").open("w") as log:
        return subprocess.Popen(command, env=own(folder, **settings), stdout=log, stderr=log, text=True)


def app(folder: Path, *command: str, **settings: str) -> forked.Forked:
    with (folder / "log").open("w") as log:
        return forked.command(*command, env=own(folder, **settings), stdout=log, stderr=log)


def lines(folder: Path) -> list[dict[str, Any]]:
    """Each line of both streams; one that is no object fails."""
    told = [json.loads(line) for line in (folder / "log").read_text().splitlines()]
    assert all({"event", "level", "timestamp", "logger"} <= line.keys() for line in told)
    return told


def wait_for(folder: Path, text: str, running: subprocess.Popen[str] | forked.Forked, seconds: float = 240) -> None:
    until = time.monotonic() + seconds
    while text not in (folder / "log").read_text():
        assert running.poll() is None, (folder / "log").read_text()[-2000:]
        assert time.monotonic() < until, (folder / "log").read_text()[-2000:]
        time.sleep(0.005)


def ended(running: subprocess.Popen[str] | forked.Forked) -> None:
    running.send_signal(signal.SIGTERM)
    assert running.wait(60) == 0


def test_what_serve_and_its_worker_and_schedule_write_is_json_from_start_to_end(
    tmp_path: Path, warm_kernels: None
) -> None:
    running = started(tmp_path, sys.executable, "-m", "app", "serve", "--port", "0", LOOPAUDIT_NO_SETTING="1")
    try:
        wait_for(tmp_path, '"ready"', running)
        ended(running)
    finally:
        running.kill()
    told = lines(tmp_path)
    events = [line["event"] for line in told]
    assert told[0] | {"timestamp": ""} == {
        **{"event": "LOOPAUDIT_NO_SETTING is no setting; docs/SETTINGS.md lists them", "level": "warning"},
        **{"logger": "loopaudit", "timestamp": ""},
    }
    assert any(event.startswith("serving on http://127.0.0.1:") for event in events)
    assert "worker: Warm shutdown (MainProcess)" in events
    assert events[-1] == "stopped"


@pytest.mark.parametrize("command", [("worker",), ("beat",)], ids=" ".join)
def test_what_a_worker_and_a_schedule_write_is_json(tmp_path: Path, warm_kernels: None, command: tuple[str]) -> None:
    migrate(Settings(data_dir=tmp_path / "data"))
    running = app(tmp_path, *command)
    try:
        if command == ("worker",):
            wait_for(tmp_path, '"ready"', running)
        else:
            time.sleep(5)
        ended(running)
    finally:
        running.kill()
    lines(tmp_path)


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (("serve",), "settings"), (("worker",), "settings"), (("beat",), "settings"), (("migrate",), "settings"),
        (("nightly",), "settings"), (("digest",), "settings"), (("backup", "kept"), "settings"),
    ],
)  # fmt: skip
def test_why_a_command_ends_is_json_with_its_code(tmp_path: Path, command: tuple[str, ...], code: str) -> None:
    assert app(tmp_path, *command, LOOPAUDIT_NIGHTLY_AT="noon").wait(60) == 2
    (told,) = lines(tmp_path)
    assert (told["level"], told["code"]) == ("error", code)
    assert told["event"].startswith("LOOPAUDIT_NIGHTLY_AT: ")


def test_what_a_command_says_at_its_end_is_json(tmp_path: Path) -> None:
    assert app(tmp_path, "migrate").wait(60) == 0
    assert lines(tmp_path)[-1]["event"].startswith("the database is at ")
    assert app(tmp_path, "backup", str(tmp_path / "kept")).wait(60) == 0
    assert lines(tmp_path)[-1]["event"].startswith(f"{tmp_path / 'kept'} holds ")


SPOILED = """
import sys, threading, warnings
from app import logs
from app.cli.configuration import load_settings
from app.settings import Settings

{configured}
class Cleared:
    def __del__(self):
        raise RuntimeError("password=hunter2")

warnings.warn("in two\\nlines", UserWarning)
del (cleared := [Cleared()])[0]
thread = threading.Thread(target=lambda: 1 / 0)
thread.start()
thread.join()
raise RuntimeError("postgresql://plant:hunter2@db/plant")
"""


@pytest.mark.parametrize("configured", ["logs.configure(Settings())", "load_settings(unattended=True)"])
def test_warnings_and_tracebacks_of_python_are_lines_without_secrets(tmp_path: Path, configured: str) -> None:
    script = SPOILED.replace("{configured}", configured)
    assert started(tmp_path, sys.executable, "-c", script).wait(60) == 1
    warned, unraisable, of_thread, fault = lines(tmp_path)
    assert "in two\nlines" in warned["event"]
    assert unraisable["exception"].endswith("RuntimeError: password=***")
    assert of_thread["exception"].endswith("ZeroDivisionError: division by zero")
    assert fault["exception"].endswith("RuntimeError: postgresql://plant:***@db/plant")
    assert (of_thread["level"], fault["level"]) == ("critical", "critical")


LOGS = """
import logging
from app.cli.configuration import load_settings

load_settings()
logging.getLogger("loopaudit.test").info("quiet")
logging.getLogger("loopaudit.test").warning("password=%s", "hunter2")
"""


def test_why_a_digest_ends_is_json_where_its_options_do_not_fit(tmp_path: Path) -> None:
    assert app(tmp_path, "digest", "--again", "--dry-run").wait(60) == 2
    assert [told["code"] for told in lines(tmp_path)] == ["dry_run_sends"]


def test_a_message_of_other_values_than_it_was_made_for_ends_no_command(tmp_path: Path) -> None:
    script = LOGS + 'logging.getLogger("a.library").warning("%s of %s", 1)\nsys.exit(7)\n'
    assert started(tmp_path, sys.executable, "-c", "import sys\n" + script).wait(60) == 7


def test_what_a_command_without_a_log_logs_is_a_line_without_secrets(tmp_path: Path) -> None:
    assert started(tmp_path, sys.executable, "-c", LOGS).wait(60) == 0
    (told,) = lines(tmp_path)
    assert (told["event"], told["logger"]) == ("password=***", "loopaudit.test")
