"""Who may call what: every route with every role, sessions and their forms, keys that end, and other sites."""

import asyncio
import re
from collections.abc import Iterator
from datetime import timedelta

import httpx
import pytest
from fastapi import WebSocket
from fastapi.routing import iter_route_contexts

from app.api.permissions import READING, ROUTES, UNGUARDED, listed
from app.main import create_app
from app.services.access import authentication, key_text, keys
from app.services.access.identity import INCLUDES, Role
from app.services.access.trail import list_trail
from app.services.backend import Backend
from app.services.upkeep.operations import migrate
from app.settings import Settings
from app.storage import keys as stored_keys
from app.storage.types import now

ROLES = [None, *Role]
EXAMPLES = {
    **{"explanation_id": "1", "note_id": "1", "upload_id": "7777", "audit_id": "7777"},
    **{"tag": "FIC1", "path": "loopaudit.css"},
}
CASES = [(method, path, role) for method, path in ROUTES for role in ROLES]


@pytest.fixture(scope="module")
def settings(tmp_path_factory) -> Settings:
    made = Settings(data_dir=tmp_path_factory.mktemp("access"), key_recheck_s=0, require_keys=True)
    migrate(made)
    return made


@pytest.fixture(scope="module")
def backend(settings) -> Iterator[Backend]:
    opened = Backend.open(settings)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def texts(backend) -> dict[Role, str]:
    day = timedelta(days=1)
    return {role: keys.create_key(backend, f"the {role}", role, lifetime=day).text for role in Role}


@pytest.fixture(scope="module")
def client(serve, settings) -> Iterator[httpx.Client]:
    with serve(create_app(settings)) as connection:
        yield connection


@pytest.fixture
def browser(client) -> Iterator[httpx.Client]:
    """A client with cookies of its own, which says where its requests come from as a browser does."""
    with httpx.Client(base_url=client.base_url, headers={"Sec-Fetch-Site": "same-origin"}) as connection:
        yield connection


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def address(path: str) -> str:
    return re.sub(r"\{(\w+)(:path)?\}", lambda found: EXAMPLES[found[1]], path)


def allowed(needs: Role | None, role: Role | None) -> bool:
    """Written out once more, so that the table is tested against words and not against itself."""
    return needs is None or (role is not None and (role == needs or role == "admin" or needs == "read"))


# The table


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


# Keys


@pytest.mark.parametrize("role", Role)
def test_a_key_has_the_announced_form(role):
    made = key_text.make(role)
    assert re.fullmatch(rf"la_{role}_[a-z2-7]{{10}}_[0-9A-Za-z]{{49}}", made.text)
    assert key_text.parse(made.text) == made


def test_a_typing_error_is_told_by_the_check_sum():
    text = key_text.make(Role.read).text
    for place in range(20, len(text)):
        wrong = text[:place] + ("x" if text[place] != "x" else "y") + text[place + 1 :]
        assert key_text.parse(wrong) is None


def test_a_key_that_claims_another_role_is_no_key(client, texts):
    body = texts[Role.read].replace("la_read_", "la_admin_")[: -key_text.CRC_LENGTH]
    forged = body + key_text._crc(body)
    assert key_text.parse(forged) is not None
    assert client.get("/v1/trail", headers=bearer(forged)).json()["code"] == "invalid_key"


@pytest.mark.parametrize("header", ["Authorization", "X-API-Key"])
def test_both_headers_carry_a_key(client, texts, header):
    value = texts[Role.read] if header == "X-API-Key" else f"bearer {texts[Role.read]}"
    assert client.get("/v1/loops", headers={header: value}).status_code == 200


def test_a_key_in_an_address_is_not_looked_at(client, texts):
    assert client.get("/v1/loops", params={"key": texts[Role.read]}).status_code == 401


@pytest.mark.parametrize("key", ["la_read_x", "x" * 5000, "la_read_aaaaaaaaaa_" + "0" * 49, "ünïcödé".encode()])
def test_wrong_keys_are_401(client, key):
    value = b"Bearer " + (key if isinstance(key, bytes) else key.encode())
    answer = client.get("/v1/loops", headers={"Authorization": value})
    assert (answer.status_code, answer.json()["code"]) == (401, "invalid_key")
    assert 'error="invalid_token"' in answer.headers["www-authenticate"]


def test_only_the_hash_is_kept(backend, texts):
    with backend.database.read() as connection:
        stored = str(connection.exec_driver_sql("SELECT * FROM keys").fetchall())
    for text in texts.values():
        assert text[-49:] not in stored


def test_a_revoked_key_is_refused_at_the_next_look(client, backend):
    made = keys.create_key(backend, "leaver", Role.read, lifetime=None)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 200
    keys.revoke_key(backend, made.key.id)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 401


def test_an_expired_key_is_refused(client, backend):
    made = keys.create_key(backend, "guest", Role.read, lifetime=timedelta(seconds=-1))
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 401
    assert next(key for key in keys.list_keys(backend) if key.id == made.key.id).state == "expired"


def test_rotation_lets_both_work_for_the_overlap_and_then_the_new_one(client, backend):
    old = keys.create_key(backend, "historian", Role.upload, lifetime=timedelta(days=30), requests_per_minute=77)
    new = keys.rotate_key(backend, old.key.id, timedelta(hours=1))
    assert (new.key.role, new.key.name, new.key.requests_per_minute) == ("upload", "historian", 77)
    for text in (old.text, new.text):
        assert client.get("/v1/loops", headers=bearer(text)).status_code == 200
    last = keys.rotate_key(backend, new.key.id, timedelta(0))
    assert client.get("/v1/loops", headers=bearer(new.text)).status_code == 401
    assert client.get("/v1/loops", headers=bearer(last.text)).status_code == 200


def test_the_last_use_is_noted(client, backend):
    made = keys.create_key(backend, "user", Role.read, lifetime=None)
    assert client.get("/v1/loops", headers=bearer(made.text)).status_code == 200

    def last_used() -> str | None:
        return next(key.last_used_at for key in keys.list_keys(backend) if key.id == made.key.id)

    for _ in range(200):
        if first := last_used():
            break
    assert first
    client.get("/v1/loops", headers=bearer(made.text))
    assert last_used() == first  # written at most once a minute


def test_too_many_requests_of_a_key_are_429_and_only_its_own(client, backend, texts):
    made = keys.create_key(backend, "eager", Role.read, lifetime=None, requests_per_minute=5)
    statuses = [client.get("/v1/loops", headers=bearer(made.text)) for _ in range(7)]
    assert [answer.status_code for answer in statuses] == [200] * 5 + [429] * 2
    assert statuses[-1].json()["code"] == "too_many_requests"
    assert 1 <= int(statuses[-1].headers["retry-after"]) <= 60
    assert client.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200


# Sessions and forms


def logged_in(browser: httpx.Client, key: str) -> str:
    """Logs in; the token that the forms of the page carry."""
    answer = browser.post("/login", data={"key": key, "next": "/"})
    assert answer.status_code == 303, answer.text
    return re.search(r'name="csrf-token" content="([\w-]{43})"', browser.get("/").text)[1]


def test_pages_lead_to_the_login_and_back(browser, texts):
    led = browser.get("/loops/FIC1?x=1")
    assert led.headers["location"] == "/login?next=%2Floops%2FFIC1%3Fx%3D1"
    assert 'value="/loops/FIC1?x=1"' in browser.get(led.headers["location"]).text
    answer = browser.post("/login", data={"key": texts[Role.read], "next": "/loops/FIC1?x=1"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/loops/FIC1?x=1")
    assert browser.get("/").status_code == 200
    assert browser.get("/v1/loops").status_code == 200


def test_the_cookie_is_for_this_site_and_no_script(browser, texts):
    answer = browser.post("/login", data={"key": texts[Role.read]})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert "Path=/" in cookie
    assert texts[Role.read][-49:] not in cookie


def test_over_https_the_cookie_is_secure_and_bound_to_the_host(browser, texts):
    answer = browser.post("/login", data={"key": texts[Role.read]}, headers={"X-Forwarded-Proto": "https"})
    assert answer.headers["set-cookie"].startswith("__Host-loopaudit_session=")
    assert "Secure" in answer.headers["set-cookie"]
    assert "max-age" in answer.headers["strict-transport-security"]


@pytest.mark.parametrize(
    "wanted", ["https://evil.example/", "//evil.example", "/\\evil.example", "javascript:alert(1)", "/a\nb"]
)
def test_the_login_leads_nowhere_else(browser, texts, wanted):
    answer = browser.post("/login", data={"key": texts[Role.read], "next": wanted})
    assert answer.headers["location"] == "/"


def test_a_wrong_key_opens_no_session(browser):
    answer = browser.post("/login", data={"key": "la_read_wrong"})
    assert answer.status_code == 401
    assert "set-cookie" not in answer.headers
    assert "not known" in answer.text


def test_a_session_changes_nothing_without_the_token_of_its_forms(browser, texts):
    token = logged_in(browser, texts[Role.audit])
    assert browser.post("/v1/audits", json={}).json()["code"] == "csrf_token"
    assert browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": "x" * 43}).json()["code"] == "csrf_token"
    assert browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": token}).status_code == 202


def test_a_form_carries_the_token_and_its_body_arrives_whole(browser, texts):
    token = logged_in(browser, texts[Role.upload])
    file = {"file": ("a.csv", b"time,PV,OP\n" + b"0,1,2\n" * 20_000, "text/csv")}
    assert browser.post("/v1/uploads", files=file).json()["code"] == "csrf_token"
    answer = browser.post("/v1/uploads", data={"csrf_token": token}, files=file)
    assert answer.status_code == 202, answer.text
    assert answer.json()["size_bytes"] == 11 + 6 * 20_000


def test_logging_out_ends_the_session(browser, texts):
    token = logged_in(browser, texts[Role.read])
    cookies = dict(browser.cookies)
    assert browser.post("/logout").json()["code"] == "csrf_token"
    assert browser.post("/logout", data={"csrf_token": token}).status_code == 303
    assert (
        browser.get("/v1/loops", headers={"Cookie": f"loopaudit_session={cookies['loopaudit_session']}"}).status_code
        == 401
    )


def test_a_session_ends_with_its_key(browser, backend):
    made = keys.create_key(backend, "visitor", Role.read, lifetime=None)
    logged_in(browser, made.text)
    keys.revoke_key(backend, made.key.id)
    assert browser.get("/v1/loops").status_code == 401
    assert browser.get("/").status_code == 303


def test_a_session_that_is_used_goes_on_and_an_idle_one_ends(browser, texts, backend, monkeypatch):
    browser.post("/login", data={"key": texts[Role.read]})
    idle = timedelta(minutes=backend.settings.session_idle_min)
    for later in (0.9, 1.8, 2.7):
        at(monkeypatch, now() + later * idle)
        assert browser.get("/v1/loops").status_code == 200
    at(monkeypatch, now() + 3.8 * idle)
    assert browser.get("/v1/loops").status_code == 401


def test_use_makes_no_session_older_than_it_may_become(browser, texts, backend, monkeypatch):
    browser.post("/login", data={"key": texts[Role.read]})
    settings = backend.settings
    steps = int(settings.session_h * 60 / settings.session_idle_min * 2)
    answers = []
    for step in range(1, steps + 2):
        at(monkeypatch, now() + step * timedelta(minutes=settings.session_idle_min / 2))
        answers.append(browser.get("/v1/loops").status_code)
    assert answers[: steps - 1] == [200] * (steps - 1)
    assert answers[-1] == 401


def at(monkeypatch, moment) -> None:
    """The service's clock stands at `moment`; that of the test goes on."""
    for module in (authentication, stored_keys):
        monkeypatch.setattr(module, "now", lambda: moment)


def test_a_session_has_the_role_of_its_key(browser, texts):
    token = logged_in(browser, texts[Role.read])
    answer = browser.post("/v1/audits", json={}, headers={"X-CSRF-Token": token})
    assert (answer.status_code, answer.json()["code"]) == (403, "role")


# Other sites

OTHER_SITES = [
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site"},
    {"Origin": "https://evil.example"},
    {"Origin": "null"},
    {"Origin": "http://127.0.0.1:1"},
]


@pytest.fixture(scope="module")
def open_client(serve, tmp_path_factory) -> Iterator[httpx.Client]:
    """Without keys, as on loopback."""
    settings = Settings(data_dir=tmp_path_factory.mktemp("open"))
    migrate(settings)
    with serve(create_app(settings)) as connection:
        yield connection


@pytest.mark.parametrize("headers", OTHER_SITES)
def test_other_sites_change_nothing_even_where_no_key_is_asked(open_client, headers):
    answer = open_client.post("/v1/audits", json={}, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (403, "cross_site")


def test_own_pages_and_other_programs_do(open_client):
    own = {"Origin": str(open_client.base_url).rstrip("/"), "Sec-Fetch-Site": "same-origin"}
    for headers in ({}, own):
        assert open_client.post("/v1/audits", json={}, headers=headers).status_code == 202


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.evil.example", ""]
)
def test_a_name_that_others_may_point_at_us_is_refused(open_client, host):
    answer = open_client.get("/v1/loops", headers={"Host": host})
    assert (answer.status_code, answer.json()["code"]) == (421, "host_not_allowed")


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8000", "127.0.0.1", "[::1]:8000", "127.8.0.1"])
def test_names_of_this_machine_are_taken(open_client, host):
    assert open_client.get("/v1/loops", headers={"Host": host}).status_code == 200


def test_with_allowed_hosts_only_these_are_taken(serve, settings, texts):
    with serve(create_app(settings.model_copy(update={"allowed_hosts": "plant.example, other.example"}))) as client:
        for host, status in (
            ("plant.example", 200),
            ("Other.Example:443", 200),
            ("evil.example", 421),
            ("127.0.0.1", 421),
        ):
            assert client.get("/v1/loops", headers={"Host": host, **bearer(texts[Role.read])}).status_code == status


def test_what_does_not_listen_on_loopback_asks_for_keys(serve, tmp_path):
    settings = Settings(data_dir=tmp_path)
    migrate(settings)
    with serve(create_app(settings, keys_required=True)) as client:
        assert client.get("/v1/loops").status_code == 401
        assert client.get("/healthz").status_code == 200


def test_while_the_data_base_is_away_nobody_gets_in_and_it_is_told_as_503(serve, tmp_path):
    address = "postgresql+psycopg://who:secret@127.0.0.1:1/none"
    settings = Settings(data_dir=tmp_path, database_url=address, require_keys=True)
    with serve(create_app(settings)) as client:
        for headers in (bearer(key_text.make(Role.admin).text), {"Cookie": "loopaudit_session=abc"}):
            answer = client.get("/v1/loops", headers=headers)
            assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
            assert answer.headers["retry-after"]
            assert "secret" not in answer.text
        assert client.get("/healthz", headers=headers).status_code == 200


# Trail


def test_the_trail_tells_who_did_what(client, backend, texts):
    answer = client.post(
        "/v1/uploads?filename=t.csv", content=b"time,PV,OP\n0,3,4\n", headers=bearer(texts[Role.upload])
    )
    rows = list_trail(backend, who="the upload", action="upload.receive").rows
    assert (rows[0].subject, rows[0].outcome) == (answer.headers["location"], "done")
    assert rows[0].request_id == answer.headers["x-request-id"]
    refused = client.post("/v1/audits", json={"tags": ["NOWHERE"]}, headers=bearer(texts[Role.audit]))
    assert refused.status_code == 400
    assert client.post("/v1/audits", json={}, headers=bearer(texts[Role.read])).status_code == 403
    assert list_trail(backend, who="the read", action="audit.start").rows[0].detail["status"] == 403
    assert list_trail(backend, who="the audit", action="audit.start").rows[0].outcome == "refused"


def test_the_trail_keeps_logins_and_wrong_keys_without_their_secrets(client, browser, backend, texts):
    logged_in(browser, texts[Role.read])
    wrong = key_text.make(Role.admin).text
    browser.cookies.clear()
    browser.post("/login", data={"key": wrong})
    rows = list_trail(backend, action="session.open").rows
    assert [(row.who, row.outcome) for row in rows[:2]] == [("nobody", "refused"), ("the read", "done")]
    assert wrong[-49:] not in str(list_trail(backend, 1000).rows)


def test_the_trail_is_for_administrators_page_by_page(client, texts):
    first = client.get("/v1/trail", params={"limit": 2}, headers=bearer(texts[Role.admin])).json()
    assert len(first["rows"]) == 2
    after = client.get(
        "/v1/trail", params={"limit": 2, "cursor": first["next_cursor"]}, headers=bearer(texts[Role.admin])
    ).json()
    assert int(after["rows"][0]["id"]) < int(first["rows"][1]["id"])


def test_uploads_say_who_sent_them(client, backend, texts):
    client.post("/v1/uploads?filename=w.csv", content=b"time,PV,OP\n0,5,6\n", headers=bearer(texts[Role.upload]))
    with backend.database.read() as connection:
        who = connection.exec_driver_sql("SELECT received_by FROM uploads ORDER BY id DESC LIMIT 1").scalar()
    assert who == "the upload"


def test_wrong_keys_from_one_address_are_slowed_down_and_good_ones_are_not(serve, settings, texts):
    with serve(create_app(settings)) as client:
        answers = [client.get("/v1/loops", headers=bearer("wrong")) for _ in range(25)]
        assert [answer.status_code for answer in answers] == [401] * 20 + [429] * 5
        assert answers[-1].headers["retry-after"]
        assert client.get("/v1/loops", headers=bearer(texts[Role.read])).status_code == 200
