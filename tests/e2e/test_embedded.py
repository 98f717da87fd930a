"""`loopaudit serve` alone: API, pages, worker and schedule on the embedded default, and nothing left behind."""

import os
import signal
import subprocess
import time

import httpx
import pytest

from tests.e2e.conftest import simulated

pytestmark = pytest.mark.timeout(600)  # cold kernels on a busy machine


@pytest.fixture(scope="module")
def service(make_processes, ready_service, free_port):
    processes = make_processes(LOOPAUDIT_SWEEP_S="2")
    processes.start(["serve", "--port", str(free_port)])
    with ready_service(processes, free_port) as running:
        yield running


@pytest.fixture(scope="module")
def audited(service, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exports")
    simulated(folder / "FIC 1.csv", "--valve", "he", "-S", "6", "-J", "2")
    simulated(folder / "=HYPERLINK.csv", "--noise", "0.3")
    url = str(service.client.base_url)
    done = service.processes.run("upload", str(folder), "--url", url, "--wait")
    assert done.returncode == 0, (done.stderr, service.processes.logs())
    assert done.stdout.count("\tdone\t") == 2
    return service.audit()


def descendants(pid: int) -> set[int]:
    listed = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True).stdout
    children: dict[int, list[int]] = {}
    for line in listed.splitlines():
        child, parent = map(int, line.split())
        children.setdefault(parent, []).append(child)
    found, open_ = set(), [pid]
    while open_:
        found.update(new := children.get(open_.pop(), []))
        open_ += new
    return found


def alive(pid: int) -> bool:
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
    return bool(state) and not state.startswith("Z")


def wait_gone(pids: set[int], seconds: float = 30) -> None:
    deadline = time.monotonic() + seconds
    while left := {pid for pid in pids if alive(pid)}:
        assert time.monotonic() < deadline, f"still there: {left}"
        time.sleep(0.1)


def test_uploads_audits_and_answers(service, audited):
    assert audited["state"] == "done", (audited, service.processes.logs())
    rows = service.client.get("/v1/reliability").json()["rows"]
    assert len(rows) == 2
    assert all(row["audit_id"] == audited["id"] for row in rows)


def test_pages_show_the_plant_and_a_loop(service, audited):
    plant = service.client.get("/")
    assert plant.status_code == 200
    assert "default-src &#39;none&#39;" not in plant.text
    assert "default-src 'none'" in plant.headers["content-security-policy"]
    for row in service.client.get("/v1/reliability").json()["rows"]:
        page = service.client.get(f"/loops/{httpx.URL('/').copy_with(path='/' + row['loop']).raw_path.decode()[1:]}")
        assert page.status_code == 200
        assert row["engine_version"] in page.text
    assert service.client.get("/static/plotly.min.js").status_code == 200


@pytest.mark.shared
def test_exports_as_plants_send_them_are_read_whole(service, audited, shared_dir):
    exports = sorted(path for path in (shared_dir / "exports").iterdir() if path.suffix in (".csv", ".txt"))
    uploads = service.upload(*exports)
    assert [upload["state"] for upload in uploads] == ["done"] * len(exports), uploads
    assert [len(upload["loops"]) for upload in uploads] == [1] * len(exports)
    assert [upload["rows_kept"] for upload in uploads] == [751, 751, 7201]


@pytest.mark.shared
def test_a_recording_is_explained_as_on_the_command_line(service, audited, shared_dir):
    service.explained_as_on_the_command_line(shared_dir / "concealed" / "case003.csv")
    assert "the sensor is stuck" in service.client.get("/loops/case003").text


def test_nightly_from_cron_ends_beside_the_running_service(service, audited):
    done = service.processes.run("nightly")
    assert done.returncode == 0, done.stderr


def test_a_killed_worker_is_started_again(service, audited):
    server = service.processes.running[0]
    before = descendants(server.pid)
    workers = [pid for pid in before if "worker" in command_of(pid)]
    assert workers, [command_of(pid) for pid in before]
    for pid in workers:
        os.kill(pid, signal.SIGKILL)
    run = service.audit(seconds=90)
    assert run["state"] == "done"
    assert service.client.get("/readyz").json()["state"] == "ready"


def command_of(pid: int) -> str:
    return subprocess.run(["ps", "-o", "args=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()


def test_a_port_in_use_is_told_in_one_line(service):
    done = service.processes.run("serve", "--port", str(service.client.base_url.port))
    assert done.returncode == 2
    assert "[cannot_listen]" in done.stderr


def test_sigterm_ends_everything(service, audited):
    """Last: the service of this module is gone afterwards."""
    server = service.processes.running[0]
    family = descendants(server.pid)
    assert len(family) >= 2
    assert service.processes.stop(server) == 0, service.processes.logs()
    wait_gone(family, seconds=5)


@pytest.fixture(scope="module")
def open_to_others(make_processes, ready_service, free_port):
    """A service that listens beyond loopback."""
    processes = make_processes()
    processes.start(["serve", "--host", "0.0.0.0", "--port", str(free_port)])  # noqa: S104 - that is the case
    with ready_service(processes, free_port) as running:
        yield running


def test_beyond_loopback_nobody_is_answered_without_a_key(open_to_others):
    refused = open_to_others.client.get("/v1/loops")
    assert (refused.status_code, refused.json()["code"]) == (401, "key_needed")
    assert open_to_others.client.post("/v1/uploads", content=b"time,PV,OP\n").status_code == 401


def test_children_end_when_the_service_is_killed(open_to_others):
    """Last: this service is gone afterwards."""
    (server,) = open_to_others.processes.running
    family = descendants(server.pid)
    assert len(family) >= 2
    server.kill()
    server.wait()
    wait_gone(family)
