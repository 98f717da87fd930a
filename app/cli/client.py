"""What the command line says to a running service over HTTP."""

import re
import time
from collections.abc import Callable
from io import BytesIO
from typing import Any

import httpx

from app.client import Client, NoServiceError, ServiceError
from app.client.connection import CSV, NO_PROBLEM, E, T, shown_address
from app.errors import DataError, RequestError

ANSWERS_WITHIN_S = 30.0
WHO_ASKS = re.compile("//.*@")
"""Name and password in what is no address."""
TRIES, PATIENCE_S = 31, 60.0
"""A busy service is asked for a minute: it says that it is to be asked again after two seconds."""


class ServiceClient(Client):
    """A connection to a service; every refusal becomes a RequestError with the service's code."""

    def __init__(self, url: str, key: str | None = None, transport: httpx.BaseTransport | None = None) -> None:
        try:
            super().__init__(
                url.rstrip("/"),
                key,
                timeout_s=ANSWERS_WITHIN_S,
                tries=TRIES,
                patience_s=PATIENCE_S,
                transport=transport,
            )
        except httpx.InvalidURL as error:
            raise DataError("url", f"{WHO_ASKS.sub('//', url)} is not an address: {error}") from error
        self.url = shown_address(self._http.base_url)

    def loop_list(self) -> str:
        """All loops of the plant as CSV."""
        return self._csv("/v1/loops", {"format": "csv"})

    def take_loop_list(self, listed: bytes) -> dict[str, Any]:
        """Sets what a CSV of loops says; the answer says which could not be set."""
        return self._asked("PATCH", "/v1/loops", content=BytesIO(listed), headers={"Content-Type": CSV})

    def until_ended(self, what: str, ask: Callable[[], E], seen: Callable[[E], None], timeout_s: float) -> E:
        """Asks until it has ended, and shows each answer; RequestError("timeout") after timeout_s seconds."""

        def shown() -> E:
            answer = ask()
            seen(answer)
            return answer

        try:
            return self.wait(shown, timeout_s)
        except TimeoutError:
            text = f"{what} has not ended after {timeout_s:.0f} s; is a worker running?"
            raise RequestError("timeout", text) from None

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
        except httpx.TransportError:
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

    def _sent(self, method: str, path: str, read: Callable[[httpx.Response], T], **request: Any) -> T:
        try:
            return super()._sent(method, path, read, **request)
        except NoServiceError as error:
            cause = error.__cause__
            text = f"no answer from {self.url}: {cause or type(cause).__name__}"
            raise RequestError("no_service", text) from error
        except ServiceError as error:
            code = f"http_{error.status}" if error.code == NO_PROBLEM else error.code
            asked = f"the service at {self.url} asks for a key: give one by --key or LOOPAUDIT_KEY"
            raise RequestError(code, asked if code == "key_needed" else error.detail) from error
