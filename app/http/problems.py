"""Every error as problem details (RFC 9457) with a stable `code`, whether a service or the framework raised it."""

import errno
import logging
from collections.abc import Callable
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.responses import JSONResponse, Response

from app.errors import DataError, LoopauditError, NotFoundError
from app.http.headers import HEADERS
from app.http.parameters import what_is_wrong
from app.http.permissions import IN_STEPS, SECOND_ONE
from app.logs import without_keys
from app.services.access.identity import request_id
from app.services.data_folder import folder_away
from app.services.database_errors import DATABASE_AWAY, commit_lost, no_room, takes_no_writes

MEDIA_TYPE = "application/problem+json"
LONGEST_ECHO = 200
MOST_ERRORS = 20
LOOK_FIRST = "look whether it is there before you send it again"
SEND_AGAIN = "send it again: done twice, it changes nothing more"

# Codes of services whose status differs from the one of their class.
STATUS_BY_CODE = {
    "upload_too_large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    "mapping_too_large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    "simulation_too_large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    "media_type": HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    "content_encoding": HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    "wrong_state": HTTPStatus.CONFLICT,
    "too_many_open": HTTPStatus.CONFLICT,
    "changed_meanwhile": HTTPStatus.PRECONDITION_FAILED,
}

CODE_BY_STATUS = {
    400: "bad_request",
    404: "no_such_route",
    405: "method_not_allowed",
    413: "body_too_large",
    415: "media_type",
    422: "invalid_request",
    408: "too_slow",
    500: "internal_error",
    503: "unavailable",
}

# Addresses for machines: whoever asks is told in JSON, a browser too.
FOR_MACHINES = ("/v1", "/healthz", "/readyz", "/metrics", "/openapi.json", "/static")

NO_MORE_FILES = (errno.EMFILE, errno.ENFILE)

AWAY = (*DATABASE_AWAY, HTTPException, ClientDisconnect)

ErrorPage = Callable[[dict[str, Any]], Response]

log = logging.getLogger("loopaudit.api")


class Refusal(Exception):
    """A request that is turned away before it reaches its route; `response` replaces the problem."""

    def __init__(
        self,
        status: int,
        code: str,
        detail: str,
        *,
        headers: dict[str, str] | None = None,
        response: Response | None = None,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.code = code
        self.detail = detail
        self.headers = headers
        self.response = response


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(description="URI of the kind of problem: urn:loopaudit:problem:<code>.")
    title: str = Field(description="The HTTP status in words.")
    status: int = Field(description="The HTTP status.")
    code: str = Field(description="Stable code that scripts may rely on.")
    detail: str = Field(description="What was got and what is needed, for people.")
    instance: str = Field(description="Path of the request.")
    request_id: str | None = Field(None, description="Names this request in the log and the trail of the service.")
    errors: list[dict[str, Any]] | None = Field(
        None, description="For invalid_request: where, and what is wrong; the first 20."
    )


def install(app: FastAPI) -> None:
    """Makes the app answer every error as a problem."""
    app.add_exception_handler(LoopauditError, _user_error)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(RequestValidationError, _invalid_request)
    for away in DATABASE_AWAY:
        app.add_exception_handler(away, _database_away)
    app.add_exception_handler(OSError, _os_error)
    app.add_exception_handler(ClientDisconnect, _gone)
    app.add_exception_handler(Exception, _fault)


def respond(
    request: Request,
    status: int,
    code: str,
    detail: str,
    *,
    headers: dict[str, str] | None = None,
    errors: list[dict[str, Any]] | None = None,
) -> Response:
    """A problem, or, for a browser that asked for a page, the page that `app.state.error_page` makes of it."""
    body = Problem(
        type=f"urn:loopaudit:problem:{code}",
        title=HTTPStatus(status).phrase,
        status=status,
        code=code,
        detail=without_keys(detail),
        instance=without_keys(request.scope["path"])[:LONGEST_ECHO],
        request_id=name_of(request),
        errors=errors,
    ).model_dump(exclude_none=True)
    page: ErrorPage | None = getattr(request.app.state, "error_page", None) if wants_page(request) else None
    if page is not None:
        answer = page(body)
        answer.headers.update(headers or {})
        return answer
    return JSONResponse(body, status_code=status, headers=headers, media_type=MEDIA_TYPE)


def name_of(request: Request) -> str | None:
    """The request's name, also where its context has ended already because a fault goes through it."""
    named: str | None = request_id.get() or request.scope.get("state", {}).get("request_id")
    return named


def wants_page(request: Request) -> bool:
    """Whether a browser asks for a page: scripts and clients take anything, or JSON."""
    path = request.scope["path"]
    if any(path == start or path.startswith(f"{start}/") for start in FOR_MACHINES):
        return False
    return "app" in request.scope and "text/html" in request.headers.get("accept", "").lower()


async def answer_to(request: Request, error: Exception) -> Response:
    """What a middleware answers, which stands outside of the handlers above."""
    if isinstance(error, Refusal):
        return error.response or respond(request, error.status, error.code, error.detail, headers=error.headers)
    if isinstance(error, HTTPException):
        return await _http_error(request, error)
    if isinstance(error, DATABASE_AWAY):
        return await _database_away(request, error)
    raise error


def status_of(error: LoopauditError) -> int:
    if error.code in STATUS_BY_CODE:
        return STATUS_BY_CODE[error.code]
    if isinstance(error, NotFoundError):
        return HTTPStatus.NOT_FOUND
    return HTTPStatus.UNPROCESSABLE_ENTITY if isinstance(error, DataError) else HTTPStatus.BAD_REQUEST


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """For OpenAPI: these statuses answer with a problem (see `schema`)."""
    return {status: {"description": HTTPStatus(status).phrase} for status in statuses}


async def _user_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, LoopauditError)  # noqa: S101 - what the registration promises, for the type checker
    return respond(request, status_of(error), error.code, error.message)


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)  # noqa: S101 - as above
    code = CODE_BY_STATUS.get(error.status_code, f"http_{error.status_code}")
    detail = str(error.detail)
    if error.status_code == HTTPStatus.NOT_FOUND:
        detail = f"no route {request.method} {request.scope['path'][:LONGEST_ECHO]}"
    return respond(request, error.status_code, code, detail, headers=dict(error.headers or {}))


async def _invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)  # noqa: S101 - as above
    route = request.scope.get("route")
    errors = [
        {"where": ".".join(map(str, item["loc"]))[:LONGEST_ECHO], "what": what_is_wrong(item, route)}
        for item in error.errors()[:MOST_ERRORS]
    ]
    detail = "; ".join(f"{item['where']}: {item['what']}" for item in errors[:3])
    return respond(request, 422, "invalid_request", detail, errors=errors)


async def _database_away(request: Request, error: Exception) -> Response:
    action = request.scope.get("state", {}).get("action")  # none before the guard let it in: nothing was begun
    if action and commit_lost(error):
        return _in_doubt(request, error, action)
    if no_room(error):
        return _disk_full(request)
    if action in IN_STEPS:
        return _in_doubt(request, error, action)
    log.error("database away while answering %s %s: %s", request.method, request.scope["path"][:LONGEST_ECHO], error)
    why = "takes nothing to be written at the moment" if takes_no_writes(error) else "does not answer"
    text = f"the database {why}; nothing was changed, try again"
    return respond(request, 503, "database_away", text, headers={"Retry-After": "5"})


def _in_doubt(request: Request, error: Exception, action: str) -> Response:
    """Where a second request would be a second one, clients must not repeat it by themselves, as they do after 503."""
    log.error("database away in the midst of %s %s: %s", request.method, request.scope["path"][:LONGEST_ECHO], error)
    request.scope["state"]["in_doubt"] = True  # for the trail
    text = "the database went away while this was written: it is not known whether it was done"
    if _would_be_a_second_one(request, action):
        return respond(request, 504, "outcome_unknown", f"{text}; {LOOK_FIRST}")
    return respond(request, 503, "database_away", f"{text}; {SEND_AGAIN}", headers={"Retry-After": "5"})


def _would_be_a_second_one(request: Request, action: str | None) -> bool:
    # With If-Match: done, the tag is another one, and a repeat is refused.
    return action in SECOND_ONE or "if-match" in request.headers


def stopped(request: Request) -> Response:
    """For what was not done when the service, told to stop, could wait no longer. What a thread is about is done to its
    end, or not: nobody hears of it."""
    action = request.scope.get("state", {}).get("action")
    text = "the service is being stopped, and this was not done by then"
    if _would_be_a_second_one(request, action):
        text += f"; it is not known whether it will be: {LOOK_FIRST}"
        return respond(request, 504, "outcome_unknown", text)
    text += f"; {SEND_AGAIN if action else 'ask again'}"
    return respond(request, 503, "unavailable", text, headers={"Retry-After": "5"})


async def _os_error(request: Request, error: Exception) -> Response:
    if no_room(error):
        return _disk_full(request)
    if isinstance(error, OSError) and error.errno == errno.EFBIG:
        log.error("no file so large for %s %s", request.method, request.scope["path"][:LONGEST_ECHO])
        text = (
            "the system lets the service write no file as large as this needs (its file system, or LimitFSIZE and "
            "`ulimit -f`); nothing was kept of it, send it in parts"
        )
        return respond(request, 413, "body_too_large", text)
    if isinstance(error, OSError) and error.errno in NO_MORE_FILES:
        log.error("no file can be opened for %s %s: %s", request.method, request.scope["path"][:LONGEST_ECHO], error)
        text = "the service has as many files and connections open as it may; try again"
        return respond(request, 503, "busy", text, headers={"Retry-After": "5"})
    if folder_away(request.app.state.backend.settings, error):
        log.error(
            "the data folder takes nothing of %s %s: %s", request.method, request.scope["path"][:LONGEST_ECHO], error
        )
        text = (
            "the data folder of the service takes nothing at the moment; nothing was kept of this, send it again later"
        )
        return respond(request, 503, "data_folder_away", text, headers={"Retry-After": "60"})
    return await _fault(request, error)


def _disk_full(request: Request) -> Response:
    log.error("no room on the disk for %s %s", request.method, request.scope["path"][:LONGEST_ECHO])
    text = "the disk of the service is full; nothing was kept of this, send it again when there is room"
    return respond(request, 507, "disk_full", text, headers={"Retry-After": "300"})


async def _gone(request: Request, error: Exception) -> Response:
    """The client went away in the middle of its upload: nobody reads this, and nothing is wrong with us."""
    return respond(request, 400, "client_gone", "the connection was closed before the body was complete")


async def _fault(request: Request, error: Exception) -> Response:
    name = name_of(request)
    told = {"request_id": name} if name else {}
    where = request.scope["path"][:LONGEST_ECHO]
    log.error("fault while answering %s %s", request.method, where, exc_info=error, extra=told)
    # The framework answers faults outside of all middleware, so the headers that it would set are set here; the server
    # closes the connection after them, and a client that is not told would send its next request into the closing.
    headers = HEADERS | {"Connection": "close"} | ({"X-Request-Id": name} if name else {})
    return respond(request, 500, "internal_error", "a fault of the service; its log says which", headers=headers)
