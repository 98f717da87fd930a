"""What the guides say is shown by commands that work: each `console` block is run, and its lines must be printed."""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
GUIDES = ("TUTORIAL.md", "guides/ENGINEER.md", "guides/EXPORTS.md", "guides/ADMINISTRATOR.md")
LINK = re.compile(r"\]\((?!http)([^)#]+)(?:#[^)]*)?\)")


@dataclass(frozen=True)
class Step:
    """A command, and the lines that its output must hold (blanks do not count; `...` holds for anything)."""

    command: str
    lines: tuple[str, ...]


def steps(text: str) -> Iterator[Step]:
    for block in re.findall(r"^```console\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, *lines = part.splitlines()
            yield Step(command, tuple(line for line in lines if line.strip() not in ("", "...")))


def plain(text: str) -> str:
    """Without the frames of tables, and with one blank for many."""
    return " ".join(re.sub(r"[│┃─━]", " ", text).split())


@pytest.fixture
def shell(tmp_path: Path) -> Iterator["Shell"]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    opened = Shell(tmp_path, port)
    yield opened
    opened.close()


class Shell:
    """Runs the commands of one guide in a folder of their own, with a free port in the place of 8000."""

    def __init__(self, folder: Path, port: int) -> None:
        own = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
        path = f"{Path(sys.executable).parent}{os.pathsep}{own['PATH']}"
        self._environment = own | {"PATH": path, "LOOPAUDIT_DATA_DIR": str(folder / "data"), "COLUMNS": "200"}
        self._folder, self._port = folder, port
        self._running: list[subprocess.Popen[bytes]] = []

    def run(self, step: Step) -> str:
        command = step.command.replace("8000", str(self._port))
        if command.startswith("export "):
            name, _, value = command.removeprefix("export ").partition("=")
            self._environment[name] = value.replace("$PWD", str(self._folder))
            return ""
        if command.endswith("&"):
            self._start(command.removesuffix("&"))
            return ""
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self._folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=900,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        return done.stdout + done.stderr

    def _start(self, command: str) -> None:
        with (self._folder / "service.log").open("wb") as log:
            started = subprocess.Popen(
                ["bash", "-c", f"exec {command}"], cwd=self._folder, env=self._environment, stdout=log, stderr=log
            )
        self._running.append(started)
        ends = time.monotonic() + 120
        while time.monotonic() < ends and started.poll() is None:
            try:
                if httpx.get(f"http://127.0.0.1:{self._port}/readyz").is_success:
                    return
            except httpx.TransportError:
                time.sleep(0.2)
        pytest.fail(f"{command} did not come up: {(self._folder / 'service.log').read_text()[-2000:]}")

    def close(self) -> None:
        for process in self._running:
            process.terminate()
            process.wait(30)


@pytest.mark.timeout(1200)  # a dozen commands, of which one starts a service: a minute, and many on a busy machine
@pytest.mark.parametrize("guide", GUIDES)
def test_the_commands_of_a_guide_print_what_it_says(guide: str, shell: Shell) -> None:
    found = list(steps((DOCS / guide).read_text(encoding="utf-8")))
    assert len(found) > 5
    for step in found:
        printed = plain(shell.run(step))
        for line in step.lines:
            assert plain(line) in printed, f"after `{step.command}`: no {line!r} in\n{printed[:3000]}"


@pytest.mark.parametrize("guide", [*GUIDES, "guides/OPERATOR.md"])
def test_links_of_a_guide_lead_to_files(guide: str) -> None:
    page = DOCS / guide
    broken = [link for link in LINK.findall(page.read_text(encoding="utf-8")) if not (page.parent / link).exists()]
    assert broken == []
