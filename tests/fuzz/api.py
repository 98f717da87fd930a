"""The running API under hostile requests: schemathesis over HTTP with all its checks, and requests of our own.

    python tests/fuzz/api.py --requests 100000 [--seed 1] [--schemathesis-seconds 300] [--found folder]
                             [--database-url postgresql://...]

Every answer is judged: no 5xx, every 4xx a problem with a code (or a page), the security headers on each, and every
upload that was taken ends as done or failed with a code. Lines of app/api are measured by coverage.py. The exit code is
1 where something was found, or where less than 85 % of the lines were reached. A seed makes our own requests again.
"""

import argparse
import asyncio
import faulthandler
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import Any

import coverage

HERE = Path(__file__).parent
LEAST_LINES_PCT = 85.0
AT_ONCE = 8
SLOWEST_S = 60.0
STALL_S = 20.0
READ_EVERY = 2000
UPLOADS_READ = 200
MEASURED = 20_000  # requests of our own after which lines are no longer counted, because counting doubles the time
IN_MEMORY = Path("/dev/shm")  # noqa: S108 - a folder of its own is made there


class Judge:
    """An ASGI app around the service that looks at every answer, whoever asked."""

    def __init__(self, app: Any, found: Path) -> None:
        self._app = app
        self.found = found
        self.finds: dict[str, str] = {}
        self.statuses: Counter[int] = Counter()
        self.codes: Counter[str] = Counter()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        # guessing is slowed by address, which all of these requests would share
        number = self.statuses.total()
        scope = {**scope, "client": (f"10.{number >> 16 & 255}.{number >> 8 & 255}.{number & 255}", 50000)}
        answer: dict[str, Any] = {"body": b""}
        sent = bytearray()

        async def seen(message: Any) -> None:
            if message["type"] == "http.response.start":
                answer.update(status=message["status"], headers=dict(message["headers"]))
            elif len(answer["body"]) < 100_000:
                answer["body"] += message.get("body", b"")
            await send(message)

        async def got() -> Any:
            message = await receive()
            sent.extend(message.get("body", b"")[:100_000])
            return message

        started = time.monotonic()
        try:
            await self._app(scope, got, seen)
        except Exception as error:  # noqa: BLE001 - whatever comes out of the app is a find
            self.note(f"raised {where(error)}", scope, bytes(sent), traceback.format_exc())
        if "status" not in answer:
            self.note("no answer at all", scope, bytes(sent), "")
            return
        self.statuses[answer["status"]] += 1
        for fault in faults(scope, answer, time.monotonic() - started):
            self.note(fault, scope, bytes(sent), answer["body"].decode("utf-8", "replace")[:2000])
        if answer["status"] >= 400 and b"problem+json" in answer["headers"].get(b"content-type", b""):
            self.codes[json.loads(answer["body"] or b"{}").get("code", "HEAD")] += 1

    def note(self, fault: str, scope: Any, body: bytes, told: str) -> None:
        key = (
            f"{fault} {scope['method']} {re.sub('[0-9]+', '#', scope['path'])[:60]}"
            if not fault.startswith("raised")
            else fault
        )
        if key in self.finds or len(self.finds) > 200:
            return
        request = {"fault": fault, "method": scope["method"], "raw_path": scope["raw_path"].decode("latin-1")}
        request |= {"query": scope["query_string"].decode("latin-1"), "body": body.decode("latin-1")}
        request |= {"headers": [[n.decode("latin-1"), hidden(n, v)] for n, v in scope["headers"]], "told": told}
        self.found.mkdir(parents=True, exist_ok=True)
        path = self.found / f"api-{len(self.finds):03d}.json"
        path.write_text(json.dumps(request, indent=1))
        self.finds[key] = str(path)
        print(f"FOUND {key}: {path}", flush=True)


def hidden(name: bytes, value: bytes) -> str:
    return "..." if name in (b"authorization", b"x-api-key", b"cookie") else value.decode("latin-1")


def where(error: BaseException) -> str:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "/app/" in frame.filename]
    return (
        f"{type(error).__name__} at {frames[-1].filename.rpartition('/app/')[2]}:{frames[-1].lineno}"
        if frames
        else repr(error)
    )


def faults(scope: Any, answer: dict[str, Any], elapsed_s: float) -> list[str]:
    """What is wrong with an answer, whatever was asked."""
    status, headers = answer["status"], answer["headers"]
    kind = headers.get(b"content-type", b"").decode("latin-1")
    found = []
    if status >= 500:
        found.append(f"status {status}")
    if elapsed_s > SLOWEST_S:
        found.append("slow")
    if headers.get(b"x-content-type-options") != b"nosniff" or b"content-security-policy" not in headers:
        found.append("no security headers")
    if status in (429, 503) and b"retry-after" not in headers:
        found.append("no Retry-After")
    if status == 405 and not headers.get(b"allow"):
        found.append("405 without Allow")
    if scope["method"] == "HEAD" or status == 304:
        return found
    if status >= 400 and "problem+json" in kind:
        problem = json.loads(answer["body"])
        found += [] if problem.get("code") and problem.get("status") == status else ["a problem without code"]
    elif status >= 400 and not kind.startswith("text/html"):
        found.append(f"{status} is no problem: {kind}")
    elif status < 300 and kind.startswith("application/json") and len(answer["body"]) < 100_000:
        json.loads(answer["body"], parse_constant=lambda word: found.append(f"{word} in JSON"))
    return found


async def hammer(app: Any, requests: Any, count: int, ends_s: float, after: Any) -> int:
    """Our own requests, some at once, until `ends_s`; `after(done)` is called now and then, away from the loop."""
    done = 0
    under_way: set[str] = set()

    async def one_after_another(share: int) -> None:
        nonlocal done
        for _ in range(share):
            if time.monotonic() > ends_s:
                return
            asked = requests.next()
            told = f"{asked.method} {asked.path!r}?{asked.query!r} {asked.body[:2000]!r}"
            under_way.add(told)
            try:
                await ask(app, asked)
            except TimeoutError:
                scope = {"method": asked.method, "path": asked.route, "raw_path": asked.path, "headers": []}
                app.note(f"no answer in {2 * SLOWEST_S:g} s", {**scope, "query_string": asked.query}, asked.body, "")
            under_way.discard(told)
            done += 1
            if done % READ_EVERY == 0:
                await asyncio.to_thread(after, done)

    shares = [count // AT_ONCE + (number < count % AT_ONCE) for number in range(AT_ONCE)]
    async with watched(app, under_way):
        await asyncio.gather(*map(one_after_another, shares))
    return done


@asynccontextmanager
async def watched(app: Any, under_way: set[Any]) -> AsyncIterator[None]:
    """Where the process stands still for STALL_S: what was asked and where each thread is, told as a find.

    The stacks are written by a thread that needs no lock of Python's, whoever holds it."""
    stacks = app.found / "stalls.txt"
    app.found.mkdir(parents=True, exist_ok=True)
    with stacks.open("w") as file:

        async def beat() -> None:
            while True:
                faulthandler.dump_traceback_later(STALL_S, file=file)
                began, written = time.monotonic(), stacks.stat().st_size
                await asyncio.sleep(1)
                if stacks.stat().st_size > written:
                    lasted = f"stood still for {time.monotonic() - began:.0f} s; under way:\n"
                    app.found.joinpath("stalled.txt").write_text(lasted + "\n".join(under_way))
                    app.finds["stood still"] = str(stacks)
                    print(f"FOUND stood still: {stacks}", flush=True)

        beating = asyncio.create_task(beat())
        try:
            yield
        finally:
            beating.cancel()
            faulthandler.cancel_dump_traceback_later()


async def ask(app: Any, asked: Any) -> None:
    from urllib.parse import unquote_to_bytes

    scope = {
        "type": "http",
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "method": asked.method,
        "scheme": "http",
        "path": unquote_to_bytes(asked.path).decode("utf-8", "replace"),
        "raw_path": asked.path,
        "query_string": asked.query,
        "root_path": "",
        "headers": asked.headers,
        "client": ("127.0.0.1", 50000),
        "server": ("127.0.0.1", 8000),
        "state": {},
    }
    parts = [asked.body[at : at + 60_000] for at in range(0, len(asked.body), 60_000)] or [b""]
    waiting = [
        {"type": "http.request", "body": part, "more_body": number < len(parts) - 1}
        for number, part in enumerate(parts)
    ]

    async def receive() -> Any:
        if waiting:
            return waiting.pop(0)
        return {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        return None

    async with asyncio.timeout(2 * SLOWEST_S):
        await app(scope, receive, send)


def logged_in(app: Any, key: str) -> tuple[str, str]:
    """A session's cookie and the token of its forms, taken as a browser would."""
    from fastapi.testclient import TestClient

    client = TestClient(app, base_url="http://localhost", follow_redirects=False)
    client.post("/login", data={"key": key})
    page = client.get("/glossary")
    token = re.search(r'<meta name="csrf-token" content="([^"]+)"', page.text)
    cookie = client.cookies["loopaudit_session"]
    return cookie, token[1] if token else ""


@contextmanager
def listening(app: Any) -> Any:
    import uvicorn

    server = uvicorn.Server(
        uvicorn.Config(app, port=int(os.environ.get("FUZZ_PORT", "0")), log_level="critical", lifespan="off")
    )
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.05)
    try:
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join(30)


def schemathesis(url: str, key: str, seconds: int, seed: int) -> int:
    """All checks of schemathesis over HTTP; the exit code of its own run."""
    if not seconds:
        return 0
    program = shutil.which("st", path=str(Path(sys.executable).parent))
    command = [program, "--config-file", str(HERE / "schemathesis.toml"), "run", f"{url}/openapi.json"]
    command += ["--header", f"Authorization: Bearer {key}", "--checks", "all", "--max-time", str(seconds)]
    command += ["--continue-on-failure", "--no-shrink", "--seed", str(seed), "--max-examples", "200", "--workers", "2"]
    # A tag may hold slashes: PATCH /v1/loops/A/health changes the loop `A/health`, and is no method that is missing.
    # tests/api/routes/test_all.py looks at 405 and Allow instead, and the judge at the Allow of every 405.
    command += ["--exclude-checks", "unsupported_method,allow_header_conformance"]
    # How many drafts its generator throws away (an id is digits, a tag no `.`) says nothing of the API.
    command += ["--suppress-health-check", "filter_too_much"]
    # a stream goes on until its run ends, and nobody works here
    command += ["--exclude-path", "/v1/audits/{audit_id}/events"]
    return subprocess.run(command, cwd=tempfile.gettempdir()).returncode


def settle_uploads(plant: Any, judge: Judge) -> None:
    """What a worker does: each upload ends as done, or failed with a code, and leaves no draft behind."""
    from app.services.intake.reading import read_upload
    from app.services.intake.uploads import list_uploads

    waiting = [upload for upload in list_uploads(plant.backend, 1000).rows if upload.state == "received"]
    for upload in waiting[:UPLOADS_READ]:
        try:
            read_upload(plant.backend, int(upload.id), "fuzz")
        except Exception as error:  # noqa: BLE001 - as above
            judge.finds[f"upload {where(error)}"] = upload.fingerprint
            kept = judge.found / f"upload-{upload.fingerprint[:12]}"
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(plant.settings.uploads_dir / upload.fingerprint, kept)
            print(f"FOUND upload {where(error)}: {kept}", flush=True)


def measured(arguments: argparse.Namespace, cover: coverage.Coverage) -> int:
    from tests.fuzz import plant as plants
    from tests.fuzz.requests import Requests

    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir=IN_MEMORY if IN_MEMORY.is_dir() else None))
    try:
        cover.stop()
        plant = plants.build(folder, arguments.database_url)
        cover.start()
        app = plants.app_of(plant)
        judge = Judge(app, Path(arguments.found))
        with listening(judge) as url:
            code = schemathesis(url, plant.keys["admin"], arguments.schemathesis_seconds, arguments.seed)
        by_schemathesis = judge.statuses.total()
        print(f"schemathesis: {by_schemathesis} requests, exit code {code}", flush=True)
        requests = Requests(app.openapi(), plant.keys, plant.tags, arguments.seed)
        requests.session = logged_in(app, plant.keys["admin"])

        def after(done: int) -> None:
            if done >= MEASURED:
                cover.stop()
            settle_uploads(plant, judge)
            requests.session = logged_in(app, plant.keys["admin"])
            print(
                f"{by_schemathesis + done} requests, {len(judge.finds)} finds, {time.monotonic() - started:.0f} s",
                flush=True,
            )

        started = time.monotonic()
        ends_s = started + 60 * arguments.minutes
        after(asyncio.run(hammer(judge, requests, max(arguments.requests - by_schemathesis, 0), ends_s, after)))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    cover.stop()
    lines = cover.report(show_missing=True, skip_covered=True)
    print(f"requests: {judge.statuses.total()}, statuses {dict(sorted(judge.statuses.items()))}")
    print(f"codes of problems: {dict(judge.codes.most_common())}")
    print(f"lines of app/api reached: {lines:.1f} % (at least {LEAST_LINES_PCT:g} %)")
    for find, path in judge.finds.items():
        print(f"FOUND {find}: {path}")
    return 1 if judge.finds or code or lines < LEAST_LINES_PCT else 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--schemathesis-seconds", type=int, default=300)
    parser.add_argument("--minutes", type=float, default=120.0, help="our own requests end after this time")
    parser.add_argument("--found", default=".fuzz/found")
    parser.add_argument("--database-url", default="", help="of an empty PostgreSQL database; otherwise SQLite")
    arguments = parser.parse_args()
    os.environ["LOOPAUDIT_LOG_LEVEL"] = "error"
    from app import kernel_cache

    kernel_cache.choose()
    cover = coverage.Coverage(source=["app/api"], data_file=None, config_file=False, concurrency="thread")
    cover.start()
    code = measured(arguments, cover)
    sys.stdout.flush()
    os._exit(code)  # threads that still look for groups of loops are not waited for


if __name__ == "__main__":
    main()
