"""What the command line says to a running service over HTTP."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx

from app.errors import DataError, RequestError

POLL_S = 0.5
PATIENCE_S = 60.0
MEDIA_TYPES = {".csv": "text/csv", ".parquet": "application/vnd.apache.parquet", ".gz": "application/gzip"}

Sent = Callable[[int], None]


@dataclass(frozen=True)
class Reading:
    """How the service is to read a file: the plant's tag mapping, the zone of stamps that name none, and what stands
    first in dates that do not tell."""

    mapping: bytes | None = None
    time_zone: str | None = None
    date_order: str | None = None


class TellingFile(FileIO):
    """A file that tells how many bytes are taken of it."""

    def __init__(self, path: Path, sent: Sent) -> None:
        super().__init__(path)
        self._sent = sent

    def read(self, size: int | None = -1, /) -> bytes:
        part = super().read(-1 if size is None else size)
        self._sent(len(part))
        return part


class ServiceClient:
    """A connection to a service; every refusal becomes a RequestError with the service's code."""

    def __init__(self, url: str, key: str | None = None) -> None:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        self._http = httpx.Client(base_url=url.rstrip("/"), headers=headers, timeout=httpx.Timeout(30.0, write=300.0))
        self.url = url

    def __enter__(self) -> "ServiceClient":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._http.close()

    def upload(self, path: Path, sent: Sent, how: Reading | None = None) -> dict[str, Any]:
        """Streams the file; the answer is the upload as the service keeps it."""
        how = how or Reading()
        given = {"filename": path.name, "time_zone": how.time_zone, "date_order": how.date_order}
        told = {name: value for name, value in given.items() if value is not None}
        deadline = time.monotonic() + PATIENCE_S
        while True:
            with TellingFile(path, sent) as file:
                answer = self._send("POST", "/v1/uploads", params=told, **_body(file, path, how.mapping))
            if answer.status_code not in (429, 503) or time.monotonic() > deadline:
                return _checked(answer)
            time.sleep(min(float(answer.headers.get("Retry-After", 1)), PATIENCE_S))

    def get(self, path: str, **params: Any) -> dict[str, Any]:
        return _checked(self._send("GET", path, params=params))

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        return _checked(self._send("POST", path, json=body))

    def patch(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        return _checked(self._send("PATCH", path, json=body))

    def loop_list(self) -> str:
        """All loops of the plant as CSV."""
        return _let_through(self._send("GET", "/v1/loops", params={"format": "csv"})).text

    def change_loops(self, listed: bytes) -> dict[str, Any]:
        """Sets what a CSV of loops says; the answer says which could not be set."""
        return _checked(self._send("PATCH", "/v1/loops", content=listed, headers={"Content-Type": "text/csv"}))

    def until(
        self,
        path: str,
        ended: Callable[[dict[str, Any]], bool],
        seen: Callable[[dict[str, Any]], None],
        timeout_s: float,
    ) -> dict[str, Any]:
        """Asks again and again until it has ended; RequestError("timeout") after timeout_s seconds."""
        deadline = time.monotonic() + timeout_s
        while True:
            state = self.get(path)
            seen(state)
            if ended(state):
                return state
            if time.monotonic() > deadline:
                raise RequestError("timeout", f"{path} has not ended after {timeout_s:.0f} s; is a worker running?")
            time.sleep(POLL_S)

    @property
    def local(self) -> bool:
        """Whether its address is one of this machine."""
        return self._http.base_url.host in ("localhost", "127.0.0.1", "::1")

    def refused(self) -> bool:
        """Whether nothing listens at its port."""
        try:
            self._http.get("/healthz")
        except httpx.ConnectError:
            return True
        except (httpx.TransportError, httpx.InvalidURL):
            return False
        return False

    def ready(self, timeout_s: float) -> bool:
        """Whether the service becomes ready within timeout_s seconds."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            try:
                if self._http.get("/readyz").status_code == httpx.codes.OK:
                    return True
            except httpx.TransportError:
                pass
            time.sleep(0.1)
        return False

    def _send(self, method: str, path: str, **request: Any) -> httpx.Response:
        try:
            return self._http.request(method, path, **request)
        except httpx.TransportError as error:
            raise RequestError("no_service", f"no answer from {self.url}: {error or type(error).__name__}") from error
        except httpx.InvalidURL as error:
            raise DataError("url", f"{self.url} is not an address: {error}") from error


def _body(file: FileIO, path: Path, mapping: bytes | None) -> dict[str, Any]:
    media_type = MEDIA_TYPES.get(path.suffix.lower(), "text/plain")
    if mapping is None:
        return {"headers": {"Content-Type": media_type}, "content": file}
    return {"files": {"file": (path.name, file, media_type), "mapping": ("mapping", mapping)}}


def _checked(answer: httpx.Response) -> dict[str, Any]:
    return _let_through(answer).json()


def _let_through(answer: httpx.Response) -> httpx.Response:
    """The answer, where it is no refusal."""
    if answer.is_success:
        return answer
    is_problem = "json" in answer.headers.get("content-type", "")
    problem = answer.json() if is_problem else {}
    raise RequestError(problem.get("code", f"http_{answer.status_code}"), problem.get("detail", answer.reason_phrase))
