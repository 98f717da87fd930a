"""What the guides say is shown by commands that work: each `console` block is run, and its lines must be printed."""

import os
import re
import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest

from tests import forked

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


@dataclass
class Service:
    """The service that a guide starts, for the guides behind it too, and the commands that guides have started."""

    folder: Path
    port: int
    process: subprocess.Popen[bytes] | None = None
    started: set[str] = field(default_factory=set)

    def started_before(self, words: Sequence[str]) -> bool:
        """Whether it is a plain command of ours that has started by itself: its start need not be asked again."""
        if words[0] != "loopaudit" or set("".join(words)) & set("|&;<>$`"):
            return False
        before = words[1] in self.started
        self.started.add(words[1])
        return before


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    made = Service(tmp_path_factory.mktemp("service"), port)
    yield made
    if made.process is not None:
        made.process.terminate()
        made.process.wait(30)


@pytest.fixture
def shell(tmp_path: Path, service: Service) -> "Shell":
    return Shell(tmp_path, service)


class Shell:
    """Runs the commands of one guide in a folder of their own, with a free port in the place of 8000."""

    def __init__(self, folder: Path, service: Service) -> None:
        own = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")}
        path = f"{Path(sys.executable).parent}{os.pathsep}{own['PATH']}"
        self._environment = own | {"PATH": path, "LOOPAUDIT_DATA_DIR": str(service.folder / "data"), "COLUMNS": "200"}
        self._folder, self._service = folder, service

    def run(self, step: Step) -> str:
        command = step.command.replace("8000", str(self._service.port))
        if command.startswith("export "):
            name, _, value = command.removeprefix("export ").partition("=")
            self._environment[name] = value.replace("$PWD", str(self._folder))
            return ""
        if command.endswith("&"):
            self._start(command.removesuffix("&"))
            return ""
        words = shlex.split(command)
        if self._service.started_before(words):
            done = forked.run(*words[1:], env=self._environment, cwd=self._folder, timeout=900)
        else:
            done = self._run_in_bash(command)
        assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
        return done.stdout + done.stderr

    def _run_in_bash(self, command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", "-c", command],
            cwd=self._folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=900,
        )

    def _start(self, command: str) -> None:
        if self._service.process is not None:
            return
        log_file = self._service.folder / "service.log"
        with log_file.open("wb") as log:
            started = subprocess.Popen(
                ["bash", "-c", f"exec {command}"], cwd=self._folder, env=self._environment, stdout=log, stderr=log
            )
        self._service.process = started
        ends = time.monotonic() + 120
        while time.monotonic() < ends and started.poll() is None:
            try:
                if httpx.get(f"http://127.0.0.1:{self._service.port}/readyz").is_success:
                    return
            except httpx.TransportError:
                time.sleep(0.2)
        pytest.fail(f"{command} did not come up: {log_file.read_text()[-2000:]}")


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
