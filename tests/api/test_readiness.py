"""/healthz and /readyz while the servers behind the API go away and come back."""

import asyncio
import signal
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from fastapi.concurrency import run_in_threadpool

from app import main
from app.http import probing
from app.http.probing import Probe
from app.main import create_app
from app.services.upkeep.tables import migrate
from app.settings import Settings
from tests.chaos.installation import MissingError, installed, until
from tests.conftest import servers_required

EXPORT = b"time,FIC1.PV,FIC1.OP\n1,2,3\n"


def readiness(url: str) -> tuple[int, str]:
    answer = httpx.get(f"{url}/readyz", timeout=30)
    return answer.status_code, answer.json()["state"]


@pytest.mark.timeout(300)
def test_each_tells_the_truth_and_goes_back_to_ready_by_itself(tmp_path: Path) -> None:
    try:
        with installed(None, {}, only_api=True) as running:
            until(running.ready, 120, running.logs())
            assert readiness(running.url) == (200, "ready")

            running.supervisor.kill("redis", signal.SIGKILL, away_s=1000)
            until(lambda: readiness(running.url) == (200, "degraded"), 30, running.logs())
            assert httpx.post(f"{running.url}/v1/uploads", content=EXPORT, timeout=30).status_code == 202

            running.supervisor.kill("postgres", signal.SIGQUIT, away_s=6)
            until(lambda: readiness(running.url) == (503, "not_ready"), 30, running.logs())
            assert httpx.get(f"{running.url}/healthz", timeout=5).json() == {"state": "alive"}
            refused = httpx.post(f"{running.url}/v1/uploads", content=EXPORT, timeout=30)
            assert (refused.status_code, refused.json()["code"]) == (503, "database_away")
            assert refused.headers["retry-after"]

            until(lambda: readiness(running.url) == (200, "degraded"), 60, running.logs())
    except MissingError as missing:
        if servers_required():
            raise
        pytest.skip(str(missing))


def test_an_older_schema_is_not_ready(serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(main, "READY_KEPT_S", 0.0)
    settings = Settings(data_dir=tmp_path)
    with serve(create_app(settings)) as client:
        assert client.get("/readyz").status_code == 503
        migrate(settings)
        assert client.get("/readyz").json()["state"] == "ready"


def test_a_crowd_that_asks_at_once_takes_one_thread() -> None:
    asked: list[int] = []

    def ask() -> int:
        asked.append(len(asked) + 1)
        time.sleep(0.05)
        return asked[-1]

    async def crowd(probe: Probe[int]) -> list[int]:
        return await asyncio.gather(*(probe.found() for _ in range(60)))

    async def twice() -> None:
        probe = Probe(ask, 0.3)
        assert set(await crowd(probe)) == {1}
        await asyncio.sleep(0.3)
        assert set(await crowd(probe)) == {1, 2}  # given while the next was awaited

    asyncio.run(twice())
    assert len(asked) == 2


def test_what_does_not_answer_is_not_waited_for_and_asked_once() -> None:
    asked: list[int] = []
    goes_on = threading.Event()

    def hang() -> str:
        asked.append(1)
        goes_on.wait(30)
        return "found"

    async def impatient() -> None:
        probe = Probe(hang, 0.3, late="no answer", patience_s=0.1)
        assert await probe.found() == "no answer"
        assert await probe.found() == "no answer"
        goes_on.set()
        await asyncio.sleep(0.1)
        assert await probe.found() == "found"

    asyncio.run(impatient())
    assert len(asked) == 1


def test_an_answer_of_long_ago_is_not_given_while_the_next_is_awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s, goes_on = 1000.0, threading.Event()
    monkeypatch.setattr(probing, "time", SimpleNamespace(monotonic=lambda: now_s))
    asked: list[int] = []

    def hang_later() -> str:
        asked.append(1)
        if len(asked) > 1:
            goes_on.wait(30)
        return "ready"

    async def asks() -> None:
        nonlocal now_s
        probe = Probe(hang_later, 1.0, late="no answer", patience_s=0.05)
        assert await probe.found() == "ready"
        now_s += probing.LONGEST_KEPT_S - 1.0
        assert await probe.found() == "ready"
        now_s += 2.0
        assert await probe.found() == "no answer"
        goes_on.set()

    asyncio.run(asks())
    assert len(asked) == 2


def test_requests_that_take_all_threads_keep_no_probe_waiting() -> None:
    goes_on = threading.Event()

    async def beside() -> str:
        crowd = [asyncio.create_task(run_in_threadpool(goes_on.wait, 30)) for _ in range(60)]
        await asyncio.sleep(0.1)
        try:
            return await Probe(lambda: "found", 0.3, late="no answer", patience_s=5.0).found()
        finally:
            goes_on.set()
            await asyncio.gather(*crowd)

    assert asyncio.run(beside()) == "found"
