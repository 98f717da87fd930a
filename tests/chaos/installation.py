"""A whole installation of its own: PostgreSQL, Redis, API, two workers and the schedule, as in docker-compose.yml."""

import contextlib
import os
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import psycopg
import redis

from app.threads import OF_LINEAR_ALGEBRA, OF_READING
from tests.chaos.loss import Clock, compiled, power_cut
from tests.chaos.processes import Managed, Supervisor

WORKERS = 2
DATA_DISK_MB = 512
DATABASE_DISK_MB = 2048


class MissingError(Exception):
    """Something that the whole needs is not on this machine."""


@dataclass(frozen=True)
class Ports:
    postgres: int
    redis: int
    api: int


def free_ports(first: int | None) -> Ports:
    """The three ports from `first` on, or any that are free."""
    if first is not None:
        return Ports(first, first + 1, first + 2)
    with contextlib.ExitStack() as stack:
        probes = [stack.enter_context(socket.socket()) for _ in range(3)]
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return Ports(*(probe.getsockname()[1] for probe in probes))


def postgres_programs() -> Path:
    """The folder of initdb and postgres."""
    candidates = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    if told := shutil.which("pg_config"):
        answer = subprocess.run([told, "--bindir"], capture_output=True, text=True, timeout=10)
        candidates.insert(0, Path(answer.stdout.strip()))
    for folder in candidates:
        if (folder / "initdb").is_file() and (folder / "postgres").is_file():
            return folder
    raise MissingError("no PostgreSQL server programs (initdb, postgres) on this machine")


def server_user() -> str | None:
    """PostgreSQL does not run as root: as which user it runs where we are root, None where we are not."""
    if os.geteuid() != 0:
        return None
    for name in ("postgres", "nobody"):
        with contextlib.suppress(KeyError):
            return pwd.getpwnam(name).pw_name
    raise MissingError("this is root, and there is no user to run PostgreSQL as")


@dataclass
class Installation:
    """Everything that runs, and how to reach it."""

    folder: Path
    ports: Ports
    supervisor: Supervisor
    environment: dict[str, str]
    library: Path | None
    own_disks: tuple[Path, ...]
    app_clock: Clock
    database_clock: Clock
    programs: Path
    taken_back: int = 0
    beats: int = 0
    fillers: list[Path] = field(default_factory=list)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.ports.api}"

    @property
    def conninfo(self) -> str:
        return f"host=127.0.0.1 port={self.ports.postgres} user=loopaudit dbname=postgres connect_timeout=3"

    @property
    def data_dir(self) -> Path:
        return self.folder / "data"

    @property
    def database_dir(self) -> Path:
        return self.folder / "database"

    @property
    def workers(self) -> list[str]:
        return [f"worker-{number}" for number in range(1, WORKERS + 1)]

    def connect(self) -> psycopg.Connection:
        return psycopg.connect(self.conninfo, autocommit=True)

    def redis(self) -> redis.Redis:
        return redis.Redis(port=self.ports.redis, socket_timeout=3, socket_connect_timeout=3)

    def start_all(self, only_api: bool = False) -> None:
        self._start_postgres()
        self._start_redis()
        self.run("migrate")
        self._start("serve", "serve", "--port", str(self.ports.api), before=self._cut_power)
        if only_api:
            return
        for name in self.workers:
            self._start(name, "worker")
        self.another_beat()

    def run(self, *arguments: str) -> None:
        subprocess.run(
            [sys.executable, "-m", "app", *arguments],
            env=self.environment,
            check=True,
            capture_output=True,
            timeout=300,
            cwd=Path(__file__).resolve().parents[2],
        )

    def another_beat(self) -> str:
        name = f"beat-{self.beats}"
        self.beats += 1
        self._start(name, "beat")
        return name

    def _cut_power(self) -> None:
        """Each start of the API finds the disk as after a power cut of its last process."""
        self.taken_back += power_cut(self.folder / "journal")

    def _preloaded(self, clock: Clock) -> dict[str, str]:
        return {} if self.library is None else {"LD_PRELOAD": str(self.library), "CHAOS_CLOCK": str(clock.path)}

    def _start(self, name: str, *arguments: str, before: Callable[[], None] | None = None) -> None:
        module = "tests.chaos.spoiled_worker" if arguments[0] == "worker" else "app"
        journal = {"CHAOS_JOURNAL": str(self.folder / "journal"), "CHAOS_DISK": str(self.data_dir / "uploads")}
        environment = {
            **self.environment,
            **self._preloaded(self.app_clock),
            **(journal if arguments[0] == "serve" else {}),
        }
        command = [sys.executable, "-m", module, *arguments]
        self.supervisor.add(Managed(name, command, environment, self.folder / f"{name}.log", before=before))

    def _start_postgres(self) -> None:
        cluster, user = self.database_dir / "postgres", server_user()
        cluster.mkdir(mode=0o700)
        if user is not None:
            shutil.chown(cluster, user, user)
        made = subprocess.run(
            [self.programs / "initdb", "-D", cluster, "-U", "loopaudit", "-A", "trust", "-E", "UTF8", "--no-locale"],
            user=user,
            group=user,
            extra_groups=None if user is None else [],
            capture_output=True,
            text=True,
            timeout=180,
            cwd="/",
        )
        if made.returncode:
            raise MissingError(f"initdb failed: {made.stderr[-500:]}")
        options = {
            "listen_addresses": "127.0.0.1",
            "unix_socket_directories": "",
            "fsync": "on",
            "synchronous_commit": "on",
            "max_connections": "60",
        }
        settings = [word for name, value in options.items() for word in ("-c", f"{name}={value}")]
        command = [self.programs / "postgres", "-D", cluster, "-p", str(self.ports.postgres), *settings]
        environment = {"PATH": os.environ.get("PATH", ""), "LC_ALL": "C", **self._preloaded(self.database_clock)}
        log = self.folder / "postgres.log"
        self.supervisor.add(Managed("postgres", command, environment, log, user=user))
        until(self._postgres_answers, 60, "PostgreSQL did not start: " + tail(log))

    def _postgres_answers(self) -> bool:
        with contextlib.suppress(psycopg.OperationalError), self.connect():
            return True
        return False

    def _start_redis(self) -> None:
        program = shutil.which("redis-server")
        if program is None:
            raise MissingError("no redis-server on this machine")
        # Without persistence: each end of it is the loss of its memory.
        command = [program, "--port", str(self.ports.redis), "--bind", "127.0.0.1", "--save", "", "--appendonly", "no"]
        here = {"PATH": os.environ.get("PATH", "")}
        self.supervisor.add(Managed("redis", [*command, "--dir", self.folder], here, self.folder / "redis.log"))
        until(self._redis_answers, 30, "Redis did not start: " + tail(self.folder / "redis.log"))

    def _redis_answers(self) -> bool:
        with contextlib.suppress(redis.RedisError):
            return bool(self.redis().ping())
        return False

    def ready(self) -> bool:
        with contextlib.suppress(httpx.HTTPError):
            return httpx.get(f"{self.url}/readyz", timeout=10).status_code == 200
        return False

    def logs(self, characters: int = 2500) -> str:
        return "\n".join(f"--- {log.name}\n{tail(log, characters)}" for log in sorted(self.folder.glob("*.log")))


def tail(path: Path, characters: int = 1500) -> str:
    return path.read_text(errors="replace")[-characters:] if path.is_file() else ""


def until(true: Callable[[], bool], seconds: float, otherwise: str) -> None:
    deadline = time.monotonic() + seconds
    while not true():
        if time.monotonic() > deadline:
            raise TimeoutError(otherwise)
        time.sleep(0.1)


@contextmanager
def installed(
    first_port: int | None,
    settings: dict[str, str],
    keep: Path | None = None,
    *,
    only_api: bool = False,
    share: int | None = None,
) -> Iterator[Installation]:
    """A running installation; afterwards no process and no file of it is left (its logs, in the folder `keep`)."""
    programs = postgres_programs()
    folder = Path(tempfile.mkdtemp(prefix="loopaudit-chaos-"))
    folder.chmod(0o755)  # the server's user passes through
    data, database = folder / "data", folder / "database"
    own_disks = tuple(
        disk for disk, room_mb in ((data, DATA_DISK_MB), (database, DATABASE_DISK_MB)) if mounted(disk, room_mb)
    )
    ports = free_ports(first_port)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("LOOPAUDIT_")} | {
        "LOOPAUDIT_DATABASE_URL": f"postgresql+psycopg://loopaudit@127.0.0.1:{ports.postgres}/postgres",
        "LOOPAUDIT_BROKER_URL": f"redis://127.0.0.1:{ports.redis}/0",
        "LOOPAUDIT_DATA_DIR": str(data),
        **dict.fromkeys(OF_LINEAR_ALGEBRA + OF_READING, "1"),
        **settings,
    }
    made = Installation(
        folder,
        ports,
        Supervisor(share),
        environment,
        compiled(folder),
        own_disks,
        Clock(folder / "clock-of-the-service"),
        Clock(folder / "clock-of-the-data-base"),
        programs,
    )
    try:
        made.start_all(only_api)
        yield made
    finally:
        left = made.supervisor.stop()
        if left:
            print(f"left behind and killed: {left}", file=sys.stderr)
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            for log in folder.glob("*.log"):
                shutil.copy(log, keep)
        for disk in own_disks:
            subprocess.run(["umount", disk], check=True, timeout=60)
        shutil.rmtree(folder)


def mounted(folder: Path, room_mb: int) -> bool:
    """Whether the new folder is a small disk of its own that can be filled: only root makes one, and not everywhere."""
    folder.mkdir(mode=0o755)
    if os.geteuid() != 0 or shutil.which("mount") is None:
        return False
    mounting = ["mount", "-t", "tmpfs", "-o", f"size={room_mb}m,mode=0755", "tmpfs", folder]
    return subprocess.run(mounting, capture_output=True, timeout=30).returncode == 0
