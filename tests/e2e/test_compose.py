"""docker-compose.yml's own commands, run natively against the local PostgreSQL and Redis."""

import csv
import io
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import httpx
import pytest
import yaml

from tests.cli import calling
from tests.e2e.conftest import simulated

ROOT = Path(__file__).resolve().parents[2]
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
SERVICES = COMPOSE["services"]
VALVES = {
    "FINE": ("--noise", "0.2"),
    "SLOW": ("--integrating", "--gain", "0.01"),
    "STICKY": ("--valve", "he", "-S", "6", "-J", "2"),
}

pytestmark = [pytest.mark.postgres, pytest.mark.redis, pytest.mark.timeout(900)]  # cold kernels on a busy machine


def command(service: str, port: int | None = None) -> list[str]:
    """A service's command without the program's name; the port is the test's own."""
    program, *arguments = SERVICES[service]["command"]
    assert program == "loopaudit"
    return [
        str(port) if before == "--port" else word
        for before, word in zip([program, *arguments], arguments, strict=False)
    ]


def settings(service: str, postgres_url: str, redis_url: str) -> dict[str, str]:
    """A service's environment with the addresses of this machine's servers; what is a container's path is left out."""
    own = {name: str(value) for name, value in SERVICES[service]["environment"].items() if name != "LOOPAUDIT_DATA_DIR"}
    assert own["LOOPAUDIT_DATABASE_URL"].startswith("postgresql+psycopg://")
    assert own["LOOPAUDIT_BROKER_URL"].startswith("redis://")
    return own | {"LOOPAUDIT_DATABASE_URL": postgres_url, "LOOPAUDIT_BROKER_URL": redis_url}


@pytest.fixture(scope="module")
def processes(make_processes, postgres_url, redis_url):
    """Own addresses for the environment that migrate has in compose."""
    return make_processes(**settings("migrate", postgres_url, redis_url), LOOPAUDIT_SWEEP_S="2")


@pytest.fixture(scope="module")
def recordings(warm_kernels, tmp_path_factory) -> list[Path]:
    """Three recordings of known valves."""
    folder = tmp_path_factory.mktemp("recordings")
    for name, valve in VALVES.items():
        simulated(folder / f"{name}.csv", *valve, "--noise", "0.05")
    return sorted(folder.iterdir())


@pytest.fixture(scope="module")
def service(processes, recordings, ready_service, free_port, postgres_url, redis_url):
    """migrate, api, beat and as many workers as compose asks for."""
    own = {name: settings(name, postgres_url, redis_url) for name in ("api", "worker", "beat")}
    migrated = processes.run(*command("migrate"))
    assert migrated.returncode == 0, migrated.stderr
    processes.start(command("api", free_port), **own["api"])
    processes.start(command("beat"), **own["beat"])
    for _ in range(SERVICES["worker"]["deploy"]["replicas"]):
        processes.start(command("worker"), **own["worker"])
    key = processes.run("keys", "create", "test", "--role", "admin")
    assert key.returncode == 0, key.stderr
    with ready_service(processes, free_port) as running:
        assert running.client.get("/v1/loops").status_code == 401
        running.client.headers["X-API-Key"] = key.stdout.strip()
        yield running


@pytest.fixture(scope="module")
def audited(service, recordings):
    uploads = service.upload(*recordings)
    assert [upload["state"] for upload in uploads] == ["done"] * 3, (uploads, service.processes.logs())
    return service.audit()


def test_every_service_has_a_health_check_but_the_one_that_ends():
    assert set(SERVICES) == {"api", "worker", "beat", "migrate", "postgres", "redis"}
    assert [name for name, service in SERVICES.items() if "healthcheck" not in service] == ["migrate"]
    assert SERVICES["worker"]["deploy"]["replicas"] == 2


def test_only_loopback_reaches_it_and_no_service_is_open():
    published = [port for service in SERVICES.values() for port in service.get("ports", ())]
    assert published
    assert all(port.startswith("127.0.0.1:") for port in published)
    assert not [name for name, service in SERVICES.items() if "LOOPAUDIT_ALLOW_OPEN" in service.get("environment", {})]


def test_the_image_copies_every_room_and_runs_as_nobody_special():
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    assert {"COPY app app", "COPY workers workers", "COPY migrations migrations"} <= set(lines)
    assert "USER loopaudit" in lines
    assert any("--require-hashes" in line for line in lines)
    allowed = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = {word for line in lines if re.match(r"COPY (?!--from)", line) for word in line.split()[1:-1]}
    assert copied == allowed


def test_two_workers_audit_what_was_uploaded_and_the_table_comes_back(service, audited):
    run = audited
    assert run["state"] == "done", (run, service.processes.logs())
    assert (run["total"], run["done"], run["failed"]) == (3, 3, 0)
    table = service.client.get("/v1/reliability").json()
    assert sorted(row["loop"] for row in table["rows"]) == ["FINE", "SLOW", "STICKY"]
    assert table["next_cursor"] is None
    text = service.client.get("/v1/reliability", params={"format": "csv"}).text
    assert {row["loop"]: row["verdict"] for row in csv.DictReader(io.StringIO(text))} == {
        row["loop"]: row["verdict"] for row in table["rows"]
    }


def test_the_health_checks_of_compose_succeed(service, audited):
    port = service.client.base_url.port
    for name in ("api", "worker", "beat"):
        kind, program, *arguments = SERVICES[name]["healthcheck"]["test"]
        assert kind == "CMD"
        if program == "python":
            code = arguments[1].replace(":8000", f":{port}")
            assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0
        else:
            done = service.processes.run(*arguments)
            assert done.returncode == 0, done.stderr


def test_nightly_runs_once_from_the_command_line(service, audited):
    done = service.processes.run("nightly", timeout=180)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["total"] == 3


def test_metrics_count_what_the_workers_did(service, audited):
    text = service.client.get("/metrics").text
    assert "loopaudit_loops 3" in text
    assert 'loopaudit_uploads{state="done"} 3' in text


def verdicts(lines: list[dict]) -> dict[str, tuple]:
    names = ("verdict", "stiction_probability", "reliability", "yper_pct", "samples")
    return {line["recording"]: tuple(line[name] for name in names) for line in lines}


@pytest.mark.shared
def test_real_recordings_get_the_verdicts_of_the_command_line(service, audited, shared_dir):
    """Every third recording as a file over HTTP, two workers: the same verdicts as `loopaudit audit` on the files, but
    for what the service hears beside each other: recordings without a date seem to be of one plant and one hour.
    """
    folder = shared_dir / "recordings"
    files = sorted(path for path in folder.glob("*.csv") if path.name != "labels.csv")[::3]
    states = Counter(upload["state"] for upload in service.upload(*files, seconds=300))
    assert states == {"done": len(files)}
    run = service.audit(seconds=600)
    assert run["state"] == "done", run
    rows = service.client.get("/v1/reliability", params={"limit": 20000}).json()["rows"]
    rows = [row for row in rows if row["loop"] not in VALVES]
    doubted = {row["loop"] for row in rows if "shaken_by_neighbour" in row["reasons"].split(";")}
    assert len(doubted) <= 1  # of some 500 pairs of one period, at a chance of 0.01
    served = verdicts([row | {"reliability": "reliable"} if row["loop"] in doubted else row for row in rows])
    audit = calling.run("audit", *files, "--format", "jsonl", "--jobs", "1")
    assert audit.exit_code == 0, audit.stderr
    alone = verdicts([json.loads(line) for line in audit.stdout.splitlines()])
    assert len(alone) == len(files) == 26
    assert served == alone


@pytest.mark.shared
def test_a_recording_is_explained_as_on_the_command_line(service, audited, shared_dir):
    service.explained_as_on_the_command_line(shared_dir / "concealed" / "case009.csv")


def test_everything_stops_on_sigterm(service, audited):
    """Last: the service of this module is gone afterwards."""
    port = service.client.base_url.port
    for process in service.processes.running:
        assert service.processes.stop(process) == 0, service.processes.logs()
    with pytest.raises(httpx.TransportError):
        httpx.get(f"http://127.0.0.1:{port}/healthz", timeout=2)
