"""Who may call what: every route with every role and with none, by one table that is complete."""

import asyncio
import re

import httpx
import pytest
from fastapi import WebSocket
from fastapi.routing import iter_route_contexts

from app.http.permissions import READING, ROUTES, UNGUARDED, listed
from app.main import create_app
from app.services.access.identity import INCLUDES, Role
from app.settings import Settings
from tests.api.access.conftest import bearer

ROLES = [None, *Role]
EXAMPLES = {
    **{"explanation_id": "1", "note_id": "1", "upload_id": "7777", "audit_id": "7777"},
    **{"tag": "FIC1", "path": "loopaudit.css"},
}
CASES = [(method, path, role) for method, path in ROUTES for role in ROLES]


def address(path: str) -> str:
    return re.sub(r"\{(\w+)(:path)?\}", lambda found: EXAMPLES[found[1]], path)


def allowed(needs: Role | None, role: Role | None) -> bool:
    """Written out once more, so that the table is tested against words and not against itself."""
    return needs is None or (role is not None and (role == needs or role == "admin" or needs == "read"))


def test_every_route_is_listed_and_every_listed_route_is_there():
    routes = {
        ("GET" if method in READING else method, path)
        for path, methods in listed(create_app(Settings()))
        for method in methods
    }
    assert routes == set(ROUTES)


def test_no_route_hides_another():
    """What the guard matches is what answers only as long as no earlier template takes a later route's paths."""
    app = create_app(Settings())
    contexts = [context for context in iter_route_contexts(app.routes) if context.methods]
    for context in contexts:
        scope = {"type": "http", "path": address(context.path), "method": min(context.methods)}
        first = next(path for path, methods in listed(app) if _answers(path, methods, scope))
        assert first == context.path


def _answers(path, methods, scope) -> bool:
    from starlette.routing import compile_path

    return scope["method"] in methods and compile_path(path)[0].match(scope["path"]) is not None


def test_whatever_changes_something_has_a_name_in_the_trail():
    assert not [route for route, permission in ROUTES.items() if route[0] not in READING and not permission.action]


def test_only_what_must_be_open_is_open():
    open_ = {route for route, permission in ROUTES.items() if permission.needs is None}
    assert open_ == {
        ("GET", "/healthz"),
        ("GET", "/readyz"),
        ("GET", "/login"),
        ("POST", "/login"),
        ("POST", "/logout"),
        ("GET", "/static/plotly.min.js"),
        ("GET", "/static/{path:path}"),
    }


def test_upload_and_audit_include_reading_and_not_each_other():
    assert {role: {str(included) for included in INCLUDES[role]} for role in Role} == {
        "read": {"read"},
        "upload": {"read", "upload"},
        "audit": {"read", "audit"},
        "admin": {"read", "upload", "audit", "admin"},
    }


@pytest.mark.parametrize(("method", "path", "role"), CASES, ids=lambda value: str(value))
def test_every_route_with_every_role(client, texts, method, path, role):
    headers = bearer(texts[role]) if role else {}
    answer = client.request(method, address(path), headers=headers)
    permission = ROUTES[method, path]
    if allowed(permission.needs, role):
        assert answer.status_code not in (403, 429, 500), answer.text
        assert answer.status_code != 401 or (method, path) == ("POST", "/login")
    elif role is not None:
        assert (answer.status_code, answer.json()["code"]) == (403, "role")
    elif permission.page:
        assert answer.status_code == (303 if method in READING else 401)
        assert method not in READING or answer.headers["location"].startswith("/login?next=")
    else:
        assert (answer.status_code, answer.json()["code"]) == (401, "key_needed")
        assert answer.headers["www-authenticate"].startswith("Bearer")
        assert answer.headers["content-type"] == "application/problem+json"


def test_a_route_that_is_not_listed_is_refused(serve, settings, texts):
    app = create_app(settings)

    @app.get("/v1/forgotten")
    def forgotten() -> str:
        return "secret"

    with serve(app) as client:
        answer = client.get("/v1/forgotten", headers=bearer(texts[Role.admin]))
    assert (answer.status_code, answer.json()["code"]) == (403, "route_not_listed")


async def from_app(app, scope) -> list[dict]:
    """What the app sends to one request without a body, straight from the protocol."""
    sent: list[dict] = []

    async def receive() -> dict:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message) -> None:
        sent.append(message)

    given = {"headers": [(b"host", b"127.0.0.1")], "query_string": b"", "server": ("127.0.0.1", 80), "client": None}
    async with app.router.lifespan_context(app):
        await app(given | {"http_version": "1.1", "scheme": "http"} | scope, receive, send)
    return sent


@pytest.mark.parametrize("prefix", ["/plant", "/loops", "/static"])
@pytest.mark.parametrize(("method", "path"), [("GET", "/v1/trail"), ("POST", "/v1/audits"), ("GET", "/")])
def test_below_a_prefix_of_another_server_it_is_as_closed(settings, prefix, method, path):
    app = create_app(settings)
    scope = {"type": "http", "method": method, "path": prefix + path, "root_path": prefix}
    start = asyncio.run(from_app(app, scope | {"raw_path": scope["path"].encode()}))[0]
    assert start["status"] == (303 if path == "/" else 401)


def test_what_the_guard_did_not_look_up_is_not_let_through(settings):
    """A route that is added while the service runs, as by a plug-in: the guard has read its table by then."""
    app = create_app(settings)

    async def answers() -> list[int]:
        scope = {"type": "http", "method": "GET", "path": "/v1/late", "raw_path": b"/v1/late", "root_path": ""}
        first = (await from_app(app, scope))[0]["status"]
        app.add_api_route("/v1/late", lambda: "secret")
        return [first, (await from_app(app, scope))[0]["status"]]

    assert asyncio.run(answers()) == [404, 404]


def test_a_websocket_is_a_route_that_nobody_listed(settings):
    app = create_app(settings)

    @app.websocket("/v1/live")
    async def live(socket: WebSocket) -> None:
        await socket.accept()

    assert ("/v1/live", UNGUARDED) in listed(app)
    sent = asyncio.run(from_app(app, {"type": "websocket", "path": "/v1/live", "scheme": "ws", "root_path": ""}))
    assert [message["type"] for message in sent] == ["websocket.close"]


@pytest.mark.parametrize(
    "path", ["/v1/loops/../trail", "/v1//trail", "/v1/trail/", "/V1/TRAIL", "/v1/%74rail", "//v1/trail"]
)
def test_other_spellings_of_a_route_open_nothing(client, texts, path):
    raw = httpx.URL(client.base_url).copy_with(raw_path=path.encode())
    answer = client.get(raw, headers=bearer(texts[Role.read]))
    assert answer.status_code in (403, 404)
    assert "rows" not in answer.text
