"""The connection to a service: a method for what scripts ask, pages followed to their end, busy servers asked again."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Protocol, Self, TypeVar
from urllib.parse import quote

import httpx

from app.client.answers import Answer, Audit, Explanation, Group, Loop, LoopsChanged, Note, Row, Trend, Upload

BUSY = (429, 503)
LONGEST_WAIT_S = 60.0
PAUSE_S = 1.0
POLL_S = 0.5
SLOWEST_WRITE_S = 300.0
"""A service whose disk is slow takes an export in pauses."""
PAGE = 1000
NO_PROBLEM = "no_problem_details"
"""The code where something else than the service refuses or answers, such as a proxy."""
CSV = "text/csv"

T = TypeVar("T")
A = TypeVar("A", bound=Answer)


class Endable(Protocol):
    @property
    def ended(self) -> bool: ...


E = TypeVar("E", bound=Endable)


class ServiceError(Exception):
    """The service refused: `code` is stable, `detail` is for people (RFC 9457)."""

    def __init__(self, status: int, code: str, detail: str) -> None:
        super().__init__(f"{code}: {detail}")
        self.status = status
        self.code = code
        self.detail = detail


class NoServiceError(ServiceError):
    """Nobody answers at the address, or not to the end; the code is `no_service`, the status 0."""

    def __init__(self, address: str, error: httpx.TransportError) -> None:
        told = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        super().__init__(0, "no_service", f"{address} does not answer: {told}")


class TellingFile(FileIO):
    """A file that tells how many bytes are taken of it."""

    def __init__(self, path: Path, sent: Callable[[int], None]) -> None:
        super().__init__(path)
        self._sent = sent

    def read(self, size: int | None = -1, /) -> bytes:
        part = super().read(-1 if size is None else size)
        self._sent(len(part))
        return part


class Client:
    """A connection. `tries`: how often a request is sent while the service says that it is busy; patience_s: but not
    where the next time would be later than this, in seconds from the first."""

    def __init__(
        self,
        url: str = "http://127.0.0.1:8000",
        key: str | None = None,
        *,
        timeout_s: float = 60.0,
        tries: int = 5,
        patience_s: float = math.inf,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        # Redirects are not followed: the key would go where the redirect leads.
        times = httpx.Timeout(timeout_s, write=max(timeout_s, SLOWEST_WRITE_S))
        self._http = httpx.Client(base_url=url, headers=headers, timeout=times, transport=transport)
        self._tries, self._patience_s = max(1, tries), patience_s

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def loops(
        self,
        *,
        unit: str | None = None,
        owner: str | None = None,
        search: str | None = None,
        retired: bool | None = None,
    ) -> Iterator[Loop]:
        """retired: only those that are, or only those that are not; None: all."""
        wanted = {"unit": unit, "owner": owner, "search": search, "retired": retired}
        return self._pages(Loop, "/v1/loops", wanted)

    def loop(self, tag: str) -> Loop:
        return Loop.of(self._get(_of_loop(tag)))

    def change_loop(self, tag: str, **changes: Any) -> Loop:
        """Sets what is named (unit, type, owner, importance, spans, retired, ...); None forgets it."""
        return Loop.of(self._asked("PATCH", _of_loop(tag), json=changes))

    def change_loops(self, loops: Sequence[Mapping[str, Any]]) -> LoopsChanged:
        """Sets what each names beside its `tag`; those that cannot be set are in `refused`, and the others are."""
        return LoopsChanged.of(self._asked("PATCH", "/v1/loops", json={"loops": [dict(loop) for loop in loops]}))

    def health(self, tag: str) -> Row:
        """The newest verdict; its key figures are in `raw`."""
        return Row.of(self._get(_of_loop(tag, "/health")))

    def verdicts(self, tag: str) -> Iterator[Row]:
        """The history, the newest first."""
        return self._pages(Row, _of_loop(tag, "/verdicts"), {})

    def trend(self, tag: str, *, points: int = 2000, start: str | None = None, end: str | None = None) -> Trend:
        return Trend.of(self._get(_of_loop(tag, "/trend"), {"points": points, "start": start, "end": end}))

    def notes(self, tag: str) -> Iterator[Note]:
        """What was written of a loop, the newest first."""
        return self._pages(Note, _of_loop(tag, "/notes"), {})

    def write_note(
        self,
        tag: str,
        text: str = "",
        *,
        work_order: str = "",
        repaired_at: datetime | str | None = None,
        shelved_until: datetime | str | None = None,
    ) -> Note:
        """At least one of these; times without an offset are UTC. repaired_at: from then on the loop is judged anew.
        shelved_until: it is left out of what to look at first until then, for which a text or a work order is needed.
        """
        times = {"repaired_at": _iso(repaired_at), "shelved_until": _iso(shelved_until)}
        said = {"text": text, "work_order": work_order, **_given(times)}
        return Note.of(self._asked("POST", _of_loop(tag, "/notes"), json=said))

    def withdraw_repair(self, tag: str, note_id: str) -> Note:
        """The repair that the note states counts no longer; the note stays."""
        return Note.of(self._asked("DELETE", _of_loop(tag, f"/notes/{quote(note_id, safe='')}/repair")))

    def end_shelving(self, tag: str, note_id: str) -> Note:
        """The loop is listed again; the note stays."""
        return Note.of(self._asked("DELETE", _of_loop(tag, f"/notes/{quote(note_id, safe='')}/shelving")))

    def explanations(self, tag: str) -> Iterator[Explanation]:
        """Those of a loop, the newest first, without their answers, which `get_explanation` has."""
        return self._pages(Explanation, _of_loop(tag, "/explanations"), {})

    def ask_explanation(
        self,
        tag: str,
        *,
        start: datetime | str | None = None,
        end: datetime | str | None = None,
        window_h: float | None = None,
        **simulation: Any,
    ) -> Explanation:
        """Has the loop compared with a simulation: one of `trace`, `csv`, `column` and `model` as in the API; without
        any the recorded one, or our own. The answer is there once it has ended:

            asked = client.ask_explanation("FIC101", window_h=8, model={"gain": 1.2, "time_constants_s": [30]})
            done = client.wait(lambda: client.get_explanation("FIC101", asked.id))
        """
        window = {"from": _iso(start), "to": _iso(end), "window_h": window_h}
        return Explanation.of(
            self._asked("POST", _of_loop(tag, "/explanations"), json=_given({**window, **simulation}))
        )

    def get_explanation(self, tag: str, explanation_id: str) -> Explanation:
        return Explanation.of(self._get(_of_loop(tag, f"/explanations/{quote(explanation_id, safe='')}")))

    def explanation_trace(self, tag: str, explanation_id: str) -> str:
        """Recording, simulations and residuals over the whole window, as CSV."""
        return self._csv(_of_loop(tag, f"/explanations/{quote(explanation_id, safe='')}/trace"))

    def groups(self) -> Iterator[Group]:
        """Loops that oscillate together, by the newest verdicts: groups in step first, the larger ones first."""
        yield from (Group.of(row) for row in self._get("/v1/groups")["rows"])

    def reliability(self, *, sort: str = "loop", **filters: Any) -> Iterator[Row]:
        """The plant's table; filters as in the API: verdict, reliability, unit, owner, likely_cause, open_order, ..."""
        return self._pages(Row, "/v1/reliability", {"sort": sort, **filters})

    def upload(
        self,
        file: Path | str,
        *,
        mapping: Path | str | bytes | None = None,
        time_zone: str | None = None,
        date_order: str | None = None,
        sent: Callable[[int], None] = lambda _: None,
    ) -> Upload:
        """Sends an export; the same content, read in the same way, is the same upload.

        mapping: a file (CSV or JSON), or what it holds, that says which tag is which signal of which loop. time_zone:
        of stamps that name none (IANA). date_order: `day` or `month`, what stands first in dates that can be read in
        both orders. sent: told how many bytes go out, part by part.
        """
        path = Path(file)
        tags = Path(mapping).read_bytes() if isinstance(mapping, Path | str) else mapping
        with TellingFile(path, sent) as stream:
            told = _given({"filename": path.name, "time_zone": time_zone, "date_order": date_order})
            return Upload.of(self._asked("POST", "/v1/uploads", params=told, **_body(stream, tags)))

    def get_upload(self, upload_id: str) -> Upload:
        return Upload.of(self._get(f"/v1/uploads/{quote(upload_id, safe='')}"))

    def start_audit(self, *, tags: Sequence[str] | None = None, unit: str | None = None) -> Audit:
        """Of the loops named, of a unit, or of the whole plant."""
        wanted = {"tags": None if tags is None else list(tags), "unit": unit}
        return Audit.of(self._asked("POST", "/v1/audits", json=_given(wanted)))

    def get_audit(self, audit_id: str) -> Audit:
        return Audit.of(self._get(f"/v1/audits/{quote(audit_id, safe='')}"))

    def cancel_audit(self, audit_id: str) -> Audit:
        """Stops a run; what it has found stays. Raises ServiceError("wrong_state") where it has ended otherwise."""
        return Audit.of(self._asked("POST", f"/v1/audits/{quote(audit_id, safe='')}/cancel"))

    def wait(self, ask: Callable[[], E], timeout_s: float = 3600.0) -> E:
        """Asks until it has ended: `client.wait(lambda: client.get_audit(run.id))`. Raises TimeoutError."""
        deadline = time.monotonic() + timeout_s
        while not (found := ask()).ended:
            if time.monotonic() > deadline:
                raise TimeoutError(f"not ended after {timeout_s:g} s")
            time.sleep(POLL_S)
        return found

    def _pages(self, kind: type[A], path: str, params: Mapping[str, Any]) -> Iterator[A]:
        cursor: str | None = None
        while True:
            page = self._get(path, {**params, "limit": PAGE, "cursor": cursor})
            yield from (kind.of(row) for row in page["rows"])
            cursor = page["next_cursor"]
            if not cursor:  # an empty one would ask for the first page again
                return

    def _get(self, path: str, params: Mapping[str, Any] | None = None) -> dict[str, Any]:
        return self._asked("GET", path, params=_given(params or {}))

    def _asked(self, method: str, path: str, **request: Any) -> dict[str, Any]:
        return self._sent(method, path, _object, **request)

    def _csv(self, path: str, params: Mapping[str, Any] | None = None) -> str:
        return self._sent("GET", path, _table, params=params)

    def _sent(
        self,
        method: str,
        path: str,
        read: Callable[[httpx.Response], T],
        *,
        params: Mapping[str, Any] | None = None,
        json: Any = None,
        headers: Mapping[str, str] | None = None,
        content: BinaryIO | None = None,
        files: Mapping[str, Any] | None = None,
    ) -> T:
        """What `read` makes of the answer, where it is no refusal. read: raises ValueError for what the service does
        not send."""
        until = time.monotonic() + self._patience_s
        for left in range(self._tries - 1, -1, -1):
            if content is not None:
                content.seek(0)  # of `files` httpx takes each from its beginning
            try:
                answer = self._http.request(
                    method, path, params=params, json=json, headers=headers, content=content, files=files
                )
            except httpx.TransportError as error:
                raise NoServiceError(shown_address(self._http.base_url), error) from error
            pause_s = _pause_s(answer)
            if answer.status_code not in BUSY or not left or time.monotonic() + pause_s > until:
                break
            time.sleep(pause_s)
        if not answer.is_success:
            raise _refusal(answer)
        try:
            return read(answer)
        except ValueError as error:  # a server of pages answers every address, so a wrong one shows here alone
            got = answer.headers.get("Content-Type", "no content type")
            told = f"{shown_address(self._http.base_url)} does not answer like loopaudit: {method} {path} gave {got}"
            raise ServiceError(answer.status_code, NO_PROBLEM, told) from error


def _body(stream: BinaryIO, mapping: bytes | None) -> dict[str, Any]:
    if mapping is None:
        return {"headers": {"Content-Type": "application/octet-stream"}, "content": stream}
    return {"files": {"file": stream, "mapping": ("mapping", mapping)}}


def shown_address(url: httpx.URL) -> str:
    """Without what it may hold beside the address, such as a password."""
    return str(url.copy_with(userinfo=b"", query=None, fragment=None)).rstrip("/")


def _iso(moment: datetime | str | None) -> str | None:
    return moment.isoformat() if isinstance(moment, datetime) else moment


def _of_loop(tag: str, rest: str = "") -> str:
    return f"/v1/loops/{quote(tag, safe='')}{rest}"


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _pause_s(answer: httpx.Response) -> float:
    told = answer.headers.get("Retry-After", "")
    return min(float(told), LONGEST_WAIT_S) if told.isdigit() else PAUSE_S


def _object(answer: httpx.Response) -> dict[str, Any]:
    found = answer.json()
    if not isinstance(found, dict):
        raise ValueError("no object")
    return found


def _table(answer: httpx.Response) -> str:
    """Any text can be read as CSV, so its kind is looked at."""
    if answer.headers.get("Content-Type", "").partition(";")[0].strip().lower() != CSV:
        raise ValueError(f"not {CSV}")
    return answer.text


def _refusal(answer: httpx.Response) -> ServiceError:
    """A proxy may answer with something else than problem details."""
    try:
        told = answer.json()
    except ValueError:
        told = None
    told = told if isinstance(told, dict) else {}
    return ServiceError(
        answer.status_code, str(told.get("code", NO_PROBLEM)), str(told.get("detail", answer.reason_phrase))
    )
