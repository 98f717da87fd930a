"""Login with a key, for people: a session in a cookie that scripts cannot read and other sites cannot send."""

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse
from starlette.datastructures import FormData
from starlette.responses import RedirectResponse, Response

from app.http.asked import SECURE_SESSION, SESSION, session_of
from app.http.callers import looked_up
from app.services.access.authentication import Authenticator, Session
from app.services.access.identity import current
from app.services.access.rates import Rates
from app.web.rendering import page

LONGEST_KEY = 200
LONGEST_ADDRESS = 2000

router = APIRouter(include_in_schema=False)


@router.get("/login")
def login(next: str = "/") -> HTMLResponse:
    return form(next)


@router.post("/login")
async def open_session(request: Request) -> Response:
    given = await request.form(max_files=0, max_fields=10)
    wanted = local(text(given, "next"))
    rates: Rates = request.app.state.rates
    access: Authenticator = request.app.state.access
    key = text(given, "key").strip()[:LONGEST_KEY]
    address = request.client.host if request.client else "unknown"
    owner = await looked_up(request.app, key, "key", address)
    if owner and (wait_s := await run_in_threadpool(rates.wait_s, owner)):  # a session is a row, and so is its trail
        return form(
            wanted,
            f"This key may make {owner.requests_per_minute} requests a minute. Try again in {wait_s} s.",
            429,
            wait_s,
        )
    session = await run_in_threadpool(access.open_session, owner) if owner else None
    if session is None:
        wait_s = await run_in_threadpool(rates.refusal_wait_s, address)
        if wait_s:
            return form(wanted, f"Too many wrong keys came from your address. Try again in {wait_s} s.", 429, wait_s)
        return form(wanted, "This key is not known, has expired or was revoked.", 401)
    request.state.identity = session.identity
    return with_cookie(RedirectResponse(wanted, status_code=303), request, session)


@router.post("/logout")
def close_session(request: Request) -> Response:
    token = session_of(request.headers)
    if token is not None:
        request.app.state.access.close_session(token)
    response = RedirectResponse("/login", status_code=303)
    for name in (SESSION, SECURE_SESSION):
        response.delete_cookie(name, path="/", secure=name == SECURE_SESSION, httponly=True, samesite="strict")
    response.headers["Clear-Site-Data"] = '"cache"'
    return response


def form(wanted: str, error: str = "", status: int = 200, wait_s: int = 0) -> HTMLResponse:
    identity = current.get()
    entered = identity is not None and identity.via in ("session", "open")
    response = page("login.html", next=local(wanted), error=error, entered=entered)
    response.status_code = status
    if wait_s:
        response.headers["Retry-After"] = str(wait_s)
    return response


def with_cookie(response: Response, request: Request, session: Session) -> Response:
    secure = request.url.scheme == "https"
    response.set_cookie(
        SECURE_SESSION if secure else SESSION,
        session.token,
        expires=session.expires_at,
        path="/",
        secure=secure,
        httponly=True,
        samesite="strict",
    )
    return response


def local(address: str) -> str:
    """An address of this service, so that nobody is led elsewhere after the login."""
    inside = address.startswith("/") and not address.startswith(("//", "/\\")) and address.isprintable()
    return address if inside and len(address) <= LONGEST_ADDRESS and "\\" not in address else "/"


def text(given: FormData, name: str) -> str:
    value = given.get(name)
    return value if isinstance(value, str) else ""
