"""The one place where requests are let in: who asks, whether this route may be called by them, how often."""

import asyncio
import logging
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote, unquote

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request, cookie_parser
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.forms import carries_token
from app.api.origins import crosses_sites, host_allowed, is_forwarded, is_loopback
from app.api.permissions import LOGIN, READING, Matched, Permission, Routes
from app.api.problems import AWAY, LONGEST_ECHO, Refusal, answer_to
from app.services.access import trail
from app.services.access.authentication import Authenticator
from app.services.access.identity import ANYONE, NOBODY, Identity, current
from app.services.access.rates import Rates
from app.services.backend import Backend
from app.settings import Settings

SESSION = "loopaudit_session"
COUNTED = (401,)  # what strangers do is noted where it is limited by address: nobody fills the trail without a key
SECURE_SESSION = f"__Host-{SESSION}"  # browsers take it over https only, and from no other host

log = logging.getLogger("loopaudit.access")


@dataclass(frozen=True)
class Asked:
    """A request as the guard sees it."""

    scope: Scope
    headers: Headers
    matched: Matched
    permission: Permission

    @property
    def changes(self) -> bool:
        return self.scope["method"] not in READING

    @property
    def address(self) -> str:
        client = self.scope.get("client")
        return client[0] if client else "unknown"

    @property
    def path(self) -> str:
        return unquote(self.scope["path"], errors="replace")


class Guard:
    """Middleware. `keys_required` None: as the settings say, and wherever it is not loopback that is listened on."""

    def __init__(self, app: ASGIApp, *, of: FastAPI, settings: Settings, keys_required: bool | None) -> None:
        self._app = app
        self._of = of
        self._settings = settings
        self._hosts = settings.allowed_host_names
        self._keys_required = keys_required
        self._routes: Routes | None = None
        self._rates: Rates = of.state.rates
        self._noting: set[asyncio.Task[None]] = set()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":  # none is listed: the server answers 403
            await send({"type": "websocket.close", "code": 1008})
            return
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        try:
            receive, asked, identity = await self._admitted(scope, receive)
        except (Refusal, *AWAY) as error:
            response = await answer_to(Request(scope), error)
            await response(scope, receive, send)
            return
        known = current.set(identity)
        try:
            await self._answered(asked, identity, receive, send)
        finally:
            current.reset(known)

    async def _admitted(self, scope: Scope, receive: Receive) -> tuple[Receive, Asked, Identity]:
        """Raises Refusal, also where no route is known here: what was not looked up is not let through."""
        headers = Headers(scope=scope)
        if not host_allowed(headers.get("host", ""), self._hosts, keys_required=self._closed(scope, headers)):
            text = "this service is not known by that name; LOOPAUDIT_ALLOWED_HOSTS lists the names it answers to"
            raise Refusal(421, "host_not_allowed", text)
        matched = self._match(scope)
        if matched is None:
            raise self._no_route(scope)
        if matched.permission is None:
            raise Refusal(403, "route_not_listed", f"{matched.path} has no entry in the table of permissions")
        asked = Asked(scope, headers, matched, matched.permission)
        if asked.changes and crosses_sites(headers):
            raise Refusal(403, "cross_site", "a page of another site sent this; only pages of this service may")
        identity = await self._identified(asked)
        if identity is not None:
            await self._count(identity)
        try:
            permit(asked, identity)
            receive = await self._with_token(asked, identity, receive)
        except Refusal as refusal:
            if identity is not None:
                await self._note(asked, identity, "refused", refusal.status)
            raise
        return receive, asked, identity or NOBODY

    def _closed(self, scope: Scope, headers: Headers) -> bool:
        """Whether a key is asked for. A proxy on this machine comes in over loopback, and who is behind it does not."""
        required = self._keys_required
        if required is None:
            server = scope.get("server")
            local = is_loopback(server[0] if server else None)
            required = self._settings.require_keys or not (local or self._settings.allow_open)
        return required or (is_forwarded(headers) and not self._settings.allow_open)

    def _match(self, scope: Scope) -> Matched | None:
        if self._routes is None:
            self._routes = Routes(self._of)
        return self._routes.match(scope)

    def _no_route(self, scope: Scope) -> Refusal:
        """The framework would name the methods of one route, where several share a path."""
        taken = self._routes.methods(scope) if self._routes else set()
        if not taken:
            return Refusal(404, "no_such_route", f"no route {scope['method']} {scope['path'][:LONGEST_ECHO]}")
        allowed = sorted(taken)
        text = f"this takes {' and '.join(allowed)}"
        return Refusal(405, "method_not_allowed", text, headers={"Allow": ", ".join(allowed)})

    async def _identified(self, asked: Asked) -> Identity | None:
        """Who asks; None: nobody said. A key or session that is not good is refused wherever one is needed."""
        if asked.permission.needs is None and not asked.permission.page:
            return None
        access: Authenticator = self._of.state.access
        key = key_of(asked.headers)
        if key is not None:
            found = access.remembered(key)
            identity = found.identity if found else await run_in_threadpool(access.key, key)
            if identity is None and asked.permission.needs is not None:
                await self._refuse_key(asked)
            return identity
        token = session_of(asked.headers)
        if token is not None:
            found = access.remembered(token)
            identity = found.identity if found else await run_in_threadpool(access.session, token)
            if identity is not None:
                return identity
        return None if self._closed(asked.scope, asked.headers) else ANYONE

    async def _with_token(self, asked: Asked, identity: Identity | None, receive: Receive) -> Receive:
        """Raises Refusal where a session changes something without the token of its forms. The login needs none: it
        opens a session of its own, and no other site can send it."""
        if identity is None or identity.via != "session" or not asked.changes or asked.permission == LOGIN:
            return receive
        carried, receive = await carries_token(asked.headers, receive, identity.form_token)
        if not carried:
            raise Refusal(403, "csrf_token", "the form has no valid csrf_token; load its page again and send it anew")
        return receive

    async def _refuse_key(self, asked: Asked) -> None:
        wait_s = self._rates.refusal_wait_s(asked.address)
        if wait_s:
            raise too_many(wait_s, "too many wrong keys came from this address")
        await self._note(asked, NOBODY, "refused", 401)
        raise unauthorized("the key is not known, has expired or was revoked", "invalid_key")

    async def _count(self, identity: Identity) -> None:
        access: Authenticator = self._of.state.access
        if identity.key_id is not None and access.due_to_note(identity):
            noting = asyncio.create_task(self._note_use(identity.key_id))
            self._noting.add(noting)
            noting.add_done_callback(self._noting.discard)
        if self._rates.shared:
            wait_s = await run_in_threadpool(self._rates.wait_s, identity)
        else:
            wait_s = self._rates.wait_s(identity)
        if wait_s:
            raise too_many(wait_s, f"this key may make {identity.requests_per_minute} requests a minute")

    async def _note_use(self, key_id: int) -> None:
        try:
            await run_in_threadpool(self._of.state.access.note_use, key_id)
        except AWAY as error:
            log.warning("the last use of a key could not be noted: %s", type(error).__name__)

    async def _answered(self, asked: Asked, identity: Identity, receive: Receive, send: Send) -> None:
        """Calls the app; what changes something stands in the trail before its answer goes out."""
        if not asked.permission.action:
            await self._app(asked.scope, receive, send)
            return
        answered = False

        async def noted(message: Message) -> None:
            nonlocal answered
            if message["type"] == "http.response.start":
                answered = True
                outcome = "done" if message["status"] < 400 else "refused" if message["status"] < 500 else "failed"
                where = MutableHeaders(scope=message).get("location")
                who = asked.scope["state"].get("identity", identity)
                if who is not NOBODY or message["status"] in COUNTED:
                    await self._note(asked, who, outcome, message["status"], where)
            await send(message)

        try:
            await self._app(asked.scope, receive, noted)
        except Exception:
            if not answered:
                await self._note(asked, identity, "failed", 500)
            raise

    async def _note(
        self, asked: Asked, identity: Identity, outcome: str, status: int, subject: str | None = None
    ) -> None:
        backend: Backend = self._of.state.backend
        action = asked.permission.action or "access"
        detail: dict[str, Any] = {"status": status, "address": asked.address}
        try:
            await run_in_threadpool(trail.record, backend, identity, action, subject or asked.path, outcome, **detail)
        except AWAY as error:
            log.error(
                "the trail could not be written: %s %s %s: %s", identity.who, action, outcome, type(error).__name__
            )


def permit(asked: Asked, identity: Identity | None) -> None:
    """Raises Refusal unless the route is open, or whoever asks has a role that it is open to."""
    needed = asked.permission.needs
    if needed is None:
        return
    if identity is None:
        if asked.permission.page and not asked.changes:
            raise Refusal(303, "login", "", response=to_login(asked))
        raise unauthorized("a key is needed: Authorization: Bearer la_..., or X-API-Key", "key_needed")
    if not identity.may(needed):
        text = f"this needs the role {needed}; the key {identity.who!r} has the role {identity.role}"
        raise Refusal(403, "role", text)


def to_login(asked: Asked) -> Response:
    query = asked.scope.get("query_string", b"").decode("latin-1")
    wanted = asked.scope["path"] + (f"?{query}" if query else "")
    return RedirectResponse(f"/login?next={quote(wanted, safe='')}", status_code=303)


def unauthorized(text: str, code: str) -> Refusal:
    error = ', error="invalid_token"' if code == "invalid_key" else ""
    return Refusal(401, code, text, headers={"WWW-Authenticate": f'Bearer realm="loopaudit"{error}'})


def too_many(wait_s: int, text: str) -> Refusal:
    return Refusal(429, "too_many_requests", f"{text}; try again in {wait_s} s", headers={"Retry-After": str(wait_s)})


def key_of(headers: Headers) -> str | None:
    """The key of a request; an address line is never looked at, because those end up in logs."""
    scheme, _, key = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        return key.strip()
    return headers.get("x-api-key")


def session_of(headers: Headers) -> str | None:
    cookies = cookie_parser(headers.get("cookie", ""))
    return cookies.get(SECURE_SESSION) or cookies.get(SESSION)
