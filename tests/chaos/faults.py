"""The faults: each really does it, to the processes and servers of the installation, and leaves the repair to them."""

import contextlib
import http.client
import io
import random
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import psycopg
import redis

from app.queue import Queue
from app.queue.jobs import queue_names
from app.settings import Settings
from app.storage.locks import Lock
from tests.chaos import spoiled_worker
from tests.chaos.client import Client, Export
from tests.chaos.installation import Installation
from tests.chaos.processes import children_of, send
from tests.chaos.watch import Injected, Watch

LONGEST_AWAY_S = 5.0
LONGEST_STOP_S = 8.0
JUMPS_S = (3600.0, -3600.0, 900.0, -900.0)
HOT_TABLES = ("uploads", "loops", "audits", "audit_items", "verdicts")
HEALTHY_BESIDE_A_BAD_ONE = 5
PATIENCE = 50
LONGEST_WAIT_S = 30.0


class SkippedFault(Exception):
    """It cannot be injected now."""


class LeftOutFault(SkippedFault):
    """It cannot be injected on this machine at all."""


@dataclass
class Scene:
    """What faults work on, with this fault's own dice."""

    installation: Installation
    client: Client
    watch: Watch
    dice: random.Random
    lease_s: float
    stopped: set[str] = field(default_factory=set)
    later: list[threading.Timer] = field(default_factory=list)
    bad_runs: list[tuple[int, str]] = field(default_factory=list)

    def away_s(self) -> float:
        return self.dice.uniform(0.0, LONGEST_AWAY_S)

    def worker(self) -> str:
        """One that runs and was not stopped by another fault; its kernels loaded, so that it works."""
        names = self.installation.workers
        going = [name for name in names if name not in self.stopped and self.installation.supervisor[name].alive()]
        busy = [name for name in going if children_of(self.installation.supervisor[name].pid)]
        if not going:
            raise SkippedFault("no worker is running at the moment")
        return self.dice.choice(busy or going)

    def beat(self) -> str:
        return next(name for name in self.installation.supervisor.managed if name.startswith("beat"))

    def after(self, seconds: float, then: Callable[[], None]) -> None:
        timer = threading.Timer(seconds, then)
        timer.daemon = True
        timer.start()
        self.later.append(timer)

    def finish(self) -> None:
        """Ends what faults have left for later, at once."""
        for timer in self.later:
            if timer.is_alive():
                timer.cancel()
                timer.join()
                timer.function()


def kill_worker_child(scene: Scene) -> None:
    parent = scene.installation.supervisor[scene.worker()].pid
    children = children_of(parent)
    if not children:
        raise SkippedFault("the worker has no child yet")
    send(scene.dice.choice(children), signal.SIGKILL)


def kill_worker_parent(scene: Scene) -> None:
    scene.installation.supervisor.kill(scene.worker(), signal.SIGKILL, scene.away_s())


def kill_worker_whole(scene: Scene) -> None:
    scene.installation.supervisor.kill(scene.worker(), signal.SIGKILL, scene.away_s(), everyone=True)


def terminate_worker(scene: Scene) -> None:
    scene.installation.supervisor.kill(scene.worker(), signal.SIGTERM, scene.away_s())


def zombie_worker(scene: Scene) -> None:
    """Stopped beyond its lease, then let go: what it finishes late belongs to another by then."""
    if scene.stopped:
        raise SkippedFault("another worker is stopped already")
    name = scene.worker()
    pids = scene.installation.supervisor[name].everyone()
    scene.stopped.add(name)
    for pid in pids:
        send(pid, signal.SIGSTOP)

    def go_on() -> None:
        for pid in pids:
            send(pid, signal.SIGCONT)
        scene.stopped.discard(name)

    scene.after(scene.lease_s + 10, go_on)


def kill_beat(scene: Scene) -> None:
    scene.installation.supervisor.kill(scene.beat(), signal.SIGKILL, scene.away_s())


def two_beats(scene: Scene) -> None:
    name = scene.installation.another_beat()
    scene.after(scene.dice.uniform(10.0, 20.0), lambda: scene.installation.supervisor.retire(name))


def kill_api(scene: Scene) -> None:
    """And the power with it: what was not synced is gone when it comes again (see loss)."""
    scene.installation.supervisor.kill("serve", signal.SIGKILL, scene.away_s())


def terminate_api(scene: Scene) -> None:
    scene.installation.supervisor.kill("serve", signal.SIGTERM, scene.away_s())


def kill_api_in_mid_upload(scene: Scene) -> None:
    export = extra_export(scene)
    connection = http.client.HTTPConnection("127.0.0.1", scene.installation.ports.api, timeout=5)
    with contextlib.closing(connection):
        connection.putrequest("POST", f"/v1/uploads?filename={export.name}")
        connection.putheader("Content-Length", str(len(export.content)))
        connection.endheaders()
        connection.send(export.content[: len(export.content) * 2 // 3])
        time.sleep(0.3)
        kill_api(scene)
    scene.client.again.append(export)


def extra_export(scene: Scene) -> Export:
    """Some of the plant's loops under names of their own, so that nothing else sends them."""
    group = scene.dice.randrange(scene.client.plant.groups)
    plain = scene.client.plant.export(group, 0)
    own = f"extra-{len(scene.watch.faults)}-"
    head, body = plain.content.split(b"\n", 1)
    columns = ["time", *(own + name for name in head.decode().split(",")[1:])]
    tags = tuple(own + tag for tag in plain.loops)
    return Export(f"{own}.csv", ",".join(columns).encode() + b"\n" + body, tags, plain.rows)


def lose_redis(scene: Scene) -> None:
    scene.installation.supervisor.kill("redis", signal.SIGKILL, scene.away_s())


def flush_redis(scene: Scene) -> None:
    for _ in range(PATIENCE):
        with contextlib.suppress(redis.RedisError):
            scene.installation.redis().flushall()
            return
        time.sleep(0.1)
    raise SkippedFault("Redis is away at the moment")


def stop_redis(scene: Scene) -> None:
    pause(scene, "redis")


def starve_redis(scene: Scene) -> None:
    """It answers, and takes no message for some seconds."""
    try:
        scene.installation.redis().config_set("maxmemory", 1)
    except redis.RedisError as away:
        raise SkippedFault("Redis is away at the moment") from away
    time.sleep(scene.dice.uniform(1.0, LONGEST_STOP_S))
    with contextlib.suppress(redis.RedisError):  # one that ended meanwhile has its memory again
        scene.installation.redis().config_set("maxmemory", 0)


def stop_postgres(scene: Scene) -> None:
    pause(scene, "postgres")


def pause(scene: Scene, name: str) -> None:
    """SIGSTOP for seconds: connections stay open, and nobody answers."""
    pids = scene.installation.supervisor[name].everyone()
    if not pids:
        raise SkippedFault(f"{name} is away already")
    for pid in pids:
        send(pid, signal.SIGSTOP)
    time.sleep(scene.dice.uniform(1.0, LONGEST_STOP_S))
    for pid in pids:
        send(pid, signal.SIGCONT)


def crash_postgres(scene: Scene) -> None:
    """`pg_ctl stop -m immediate`: no checkpoint, recovery from the log at the next start."""
    scene.installation.supervisor.kill("postgres", signal.SIGQUIT, scene.away_s())


def restart_postgres(scene: Scene) -> None:
    scene.installation.supervisor.kill("postgres", signal.SIGINT, scene.away_s())


def kill_postgres_backend(scene: Scene) -> None:
    """One of its processes dies; PostgreSQL ends all connections and recovers by itself."""
    query = "SELECT pid FROM pg_stat_activity WHERE application_name = 'loopaudit'"
    for _ in range(PATIENCE):
        with contextlib.suppress(psycopg.OperationalError), scene.installation.connect() as connection:
            if pids := sorted(row[0] for row in connection.execute(query)):
                send(scene.dice.choice(pids), signal.SIGKILL)
                return
        time.sleep(0.1)
    raise SkippedFault("no connection of the service to be killed")


def double_tasks(scene: Scene) -> None:
    """Every message that waits is there twice, and every open run and every upload is asked for once more."""
    told = scene.installation.environment
    settings = Settings(
        broker_url=told["LOOPAUDIT_BROKER_URL"],
        database_url=told["LOOPAUDIT_DATABASE_URL"],
        plant=told.get("LOOPAUDIT_PLANT", "plant"),
    )
    with contextlib.suppress(redis.RedisError):
        server = scene.installation.redis()
        for name in queue_names(settings).values():
            for message in server.lrange(name, 0, 200):
                server.rpush(name, message)
    queue = Queue(settings)
    try:
        for run in list(scene.client.runs)[-3:]:
            queue.audit_chunks(run, 5)
        for promise in scene.client.promises[-10:]:
            queue.read_upload(promise.upload_id)
        queue.sweep()
    finally:
        queue.close()


def bad_loop(tag: str) -> Callable[[Scene], None]:
    """Starts a run with a loop in it that is bad for its worker, beside healthy ones."""

    def audit_it(scene: Scene) -> None:
        healthy = scene.dice.sample(scene.client.plant.tags, HEALTHY_BESIDE_A_BAD_ONE)
        with scene.client.http() as asking:
            tries = (scene.client.start_run(asking, [tag, *healthy]) or time.sleep(0.5) for _ in range(PATIENCE))
            run = next((number for number in tries if number is not None), None)
        if run is None:
            raise SkippedFault("the service did not answer")
        scene.bad_runs.append((run, tag))

    return audit_it


def fill_data_disk(scene: Scene) -> None:
    """Uploads are sent all the while."""
    fill_disk(scene, scene.installation.data_dir)


def fill_database_disk(scene: Scene) -> None:
    """A PostgreSQL that needs more room for its log ends itself, and cannot start before there is some."""
    fill_disk(scene, scene.installation.database_dir)


def fill_disk(scene: Scene, disk: Path) -> None:
    """It has no byte left for some seconds."""
    if disk not in scene.installation.own_disks:
        raise LeftOutFault("only root can mount a disk of its own")
    filler = disk / f"filler-{len(scene.watch.faults)}"
    with filler.open("wb", buffering=0) as file:
        take_all_room(file)
        until_freed = time.monotonic() + scene.dice.uniform(2.0, LONGEST_STOP_S)
        while time.monotonic() < until_freed:
            time.sleep(0.05)
            take_all_room(file)  # that which others gave back meanwhile
    filler.unlink()


def take_all_room(file: io.FileIO) -> None:
    with contextlib.suppress(OSError):
        while True:
            file.write(bytes(1 << 20))


def jump_clock(scene: Scene) -> None:
    """Of API, workers and schedule, back or ahead; it stays there until the next jump."""
    needs_shim(scene)
    scene.installation.app_clock.jump(scene.dice.choice(JUMPS_S))


def jump_database_clock(scene: Scene) -> None:
    needs_shim(scene)
    scene.installation.database_clock.jump(scene.dice.choice(JUMPS_S))


def needs_shim(scene: Scene) -> None:
    if scene.installation.library is None:
        raise LeftOutFault("no C compiler, so that no clock can be changed")


def migrate_meanwhile(scene: Scene) -> None:
    """`loopaudit migrate`, and what a newer version's migration would do: a column more on every busy table."""
    scene.installation.run("migrate")
    with contextlib.suppress(psycopg.Error), scene.installation.connect() as connection, connection.transaction():
        connection.execute("SELECT pg_advisory_xact_lock(%s)", (Lock.MIGRATING.value,))
        connection.execute("SET LOCAL lock_timeout = '5s'")
        for table in HOT_TABLES:
            connection.execute(f"ALTER TABLE {table} DROP COLUMN IF EXISTS of_a_newer_version")
            connection.execute(f"ALTER TABLE {table} ADD COLUMN of_a_newer_version text NOT NULL DEFAULT ''")
        time.sleep(1.0)


def lose_machine(scene: Scene) -> None:
    """Everything of ours at once: API, workers and schedule."""
    for name in ("serve", *scene.installation.workers, scene.beat()):
        if name not in scene.stopped and scene.installation.supervisor[name].alive():
            scene.installation.supervisor.kill(name, signal.SIGKILL, scene.away_s(), everyone=True)


@dataclass(frozen=True)
class Fault:
    """`at_work`: it waits for loops to be held, because workers without any have nothing to lose."""

    name: str
    inject: Callable[[Scene], None]
    weight: float = 1.0
    at_work: bool = False


FAULTS = (
    Fault("kill -9 a worker's child", kill_worker_child, 2.0, at_work=True),
    Fault("kill -9 a worker's parent", kill_worker_parent, 1.5, at_work=True),
    Fault("kill -9 a worker whole", kill_worker_whole, 2.0, at_work=True),
    Fault("SIGTERM a worker", terminate_worker, at_work=True),
    Fault("worker stopped beyond its lease", zombie_worker, 0.6, at_work=True),
    Fault("kill -9 the schedule", kill_beat),
    Fault("two schedules", two_beats, 0.7),
    Fault("kill -9 the API, unsynced writes lost", kill_api, 1.5),
    Fault("kill -9 the API in mid upload", kill_api_in_mid_upload, 1.2),
    Fault("SIGTERM the API", terminate_api, 0.7),
    Fault("kill -9 Redis, its memory lost", lose_redis, 1.2),
    Fault("Redis flushed", flush_redis, 1.2),
    Fault("Redis stopped", stop_redis, 0.7),
    Fault("Redis without memory", starve_redis, 0.7),
    Fault("PostgreSQL stopped at once", crash_postgres, 1.2),
    Fault("PostgreSQL restarted", restart_postgres),
    Fault("PostgreSQL stopped", stop_postgres, 0.7),
    Fault("kill -9 a PostgreSQL backend", kill_postgres_backend),
    Fault("every task twice", double_tasks),
    Fault("a loop that kills its worker", bad_loop(spoiled_worker.KILL), 0.5),
    Fault("a loop that hangs its worker", bad_loop(spoiled_worker.HANG), 0.3),
    Fault("a loop beyond its time", bad_loop(spoiled_worker.SLOW), 0.5),
    Fault("a loop beyond its memory", bad_loop(spoiled_worker.MEMORY), 0.5),
    Fault("the data folder's disk full", fill_data_disk, 0.7),
    Fault("the database's disk full", fill_database_disk, 0.7),
    Fault("the service's clock jumps", jump_clock, 0.8),
    Fault("the database's clock jumps", jump_database_clock, 0.8),
    Fault("migration meanwhile", migrate_meanwhile, 0.8),
    Fault("everything but the servers lost", lose_machine, 0.5),
)
BY_NAME = {fault.name: fault for fault in FAULTS}


@dataclass(frozen=True)
class Planned:
    at_s: float
    fault: Fault
    seed: int


def schedule(seed: int, count: int, kinds: list[Fault], pace: float = 1.0) -> list[Planned]:
    """Which fault when: the same for the same seed. Gaps of 5 to 20 s (times `pace`), most of them short; every kind at
    least once."""
    dice = random.Random(seed)
    once = dice.sample(kinds, min(len(kinds), count))
    rest = dice.choices(kinds, weights=[fault.weight for fault in kinds], k=count - len(once))
    chosen = [*once, *rest]
    dice.shuffle(chosen)
    planned, at_s = [], 0.0
    for fault in chosen:
        at_s += pace * (5.0 + 15.0 * dice.betavariate(1.0, 4.2))
        planned.append(Planned(at_s, fault, dice.randrange(1 << 30)))
    return planned


def inject(scene: Scene, planned: Planned) -> Injected:
    deadline = time.monotonic() + LONGEST_WAIT_S
    while planned.fault.at_work and not scene.watch.claims and time.monotonic() < deadline:
        time.sleep(0.05)
    noted = scene.watch.note(planned.fault.name)
    try:
        planned.fault.inject(replace(scene, dice=random.Random(planned.seed)))
    except SkippedFault as reason:
        noted.skipped, noted.left_out = str(reason), isinstance(reason, LeftOutFault)
    except Exception as error:  # noqa: BLE001 - whatever kept it from being done, it must not count as done
        noted.skipped = f"{type(error).__name__}: {error}"
    return noted


def log_line(noted: Injected, started: float) -> str:
    what = f"skipped: {noted.skipped}" if noted.skipped else f"{len(noted.held)} loops were held"
    return f"{noted.at - started:7.1f} s  {noted.kind}  ({what})"


def tell(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", file=sys.stderr, flush=True)
