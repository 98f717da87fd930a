"""The one place where requests are let in: who asks, whether this route may be called by them, how often."""

from urllib.parse import quote

from fastapi import FastAPI
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.asked import Asked
from app.http.callers import Callers, unauthorized
from app.http.forms import carries_token
from app.http.noting import answer_noted, note
from app.http.origins import crosses_sites, host_allowed, host_name, is_forwarded, is_loopback, names_a_machine
from app.http.permissions import LOGIN, PROBES, Matched, Routes, instead
from app.http.problems import AWAY, LONGEST_ECHO, Refusal, answer_to
from app.services.access.identity import NOBODY, Identity, current
from app.settings import Settings


class Guard:
    """Middleware. `keys_required` None: as the settings say, and wherever it is not loopback that is listened on."""

    def __init__(self, app: ASGIApp, *, of: FastAPI, settings: Settings, keys_required: bool | None) -> None:
        self._app = app
        self._of = of
        self._settings = settings
        self._hosts = settings.allowed_host_names
        self._keys_required = keys_required
        self._routes: Routes | None = None
        self._callers = Callers(of)

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
        scope.setdefault("state", {})["action"] = asked.permission.action
        known = current.set(identity)
        try:
            await answer_noted(self._app, self._of, asked, identity, receive, send)
        finally:
            current.reset(known)

    async def _admitted(self, scope: Scope, receive: Receive) -> tuple[Receive, Asked, Identity]:
        """Raises Refusal, also where no route is known here: what was not looked up is not let through."""
        headers = Headers(scope=scope)
        closed = self._closed(scope, headers)
        if not self._called_by_name(scope, headers, closed=closed):
            text = "this service is not known by that name; LOOPAUDIT_ALLOWED_HOSTS lists the names it answers to"
            raise Refusal(421, "host_not_allowed", text)
        matched = self._match(scope)
        if matched is None:
            raise self._no_route(scope)
        if matched.permission is None:
            raise Refusal(403, "route_not_listed", f"{matched.path} has no entry in the table of permissions")
        asked = Asked(scope, headers, matched.permission)
        if asked.changes and crosses_sites(headers):
            raise Refusal(403, "cross_site", "a page of another site sent this; only pages of this service may")
        identity = await self._callers.identified(asked, closed=closed)
        if identity is not None:
            await self._callers.count(identity)
        try:
            permit(asked, identity)
            receive = await with_token(asked, identity, receive)
        except Refusal as refusal:
            if identity is not None:
                await note(self._of, asked, identity, "refused", refusal.status)
            raise
        return receive, asked, identity or NOBODY

    def _called_by_name(self, scope: Scope, headers: Headers, *, closed: bool) -> bool:
        """Probes know the address of a machine or a container, and no name that a proxy has."""
        host = headers.get("host", "")
        if host_allowed(host, self._hosts, keys_required=closed):
            return True
        return scope["path"] in PROBES and names_a_machine(host_name(host))

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
        text = f"this takes {' and '.join(allowed)}{instead(scope['method'], scope['path'])}"
        return Refusal(405, "method_not_allowed", text, headers={"Allow": ", ".join(allowed)})


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


async def with_token(asked: Asked, identity: Identity | None, receive: Receive) -> Receive:
    """Raises Refusal where a session changes something without the token of its forms. The login needs none: it
    opens a session of its own, and no other site can send it."""
    if identity is None or identity.via != "session" or not asked.changes or asked.permission == LOGIN:
        return receive
    carried, receive = await carries_token(asked.headers, receive, identity.form_token)
    if not carried:
        raise Refusal(403, "csrf_token", "the form has no valid csrf_token; reload its page and send it again")
    return receive


def to_login(asked: Asked) -> Response:
    query = asked.scope.get("query_string", b"").decode("latin-1")
    wanted = asked.scope["path"] + (f"?{query}" if query else "")
    return RedirectResponse(f"/login?next={quote(wanted, safe='')}", status_code=303)
