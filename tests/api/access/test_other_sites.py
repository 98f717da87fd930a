"""What other sites may do in a browser that reaches this service, and under which names it answers."""

from collections.abc import Iterator

import httpx
import pytest

from app.main import create_app
from app.services.access import key_text
from app.services.access.identity import Role
from app.settings import Settings
from tests.api.access.conftest import bearer

OTHER_SITES = [
    {"Sec-Fetch-Site": "cross-site"},
    {"Sec-Fetch-Site": "same-site"},
    {"Origin": "https://evil.example"},
    {"Origin": "null"},
    {"Origin": "http://127.0.0.1:1"},
]


@pytest.fixture(scope="module")
def open_client(serve, tmp_path_factory, make_tables) -> Iterator[httpx.Client]:
    """Without keys, as on loopback."""
    settings = Settings(data_dir=tmp_path_factory.mktemp("open"))
    make_tables(settings)
    with serve(create_app(settings)) as connection:
        yield connection


@pytest.mark.parametrize("headers", OTHER_SITES)
def test_other_sites_change_nothing_even_where_no_key_is_asked(open_client, headers):
    answer = open_client.post("/v1/audits", json={}, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (403, "cross_site")


def test_own_pages_and_other_programs_do(open_client):
    own = {"Origin": str(open_client.base_url).rstrip("/"), "Sec-Fetch-Site": "same-origin"}
    by_origin = [{"Origin": own["Origin"]}, {"Origin": "http://LOCALHOST:1", "Host": "localhost:1"}]  # all they say
    for headers in ({}, own, *by_origin):
        assert open_client.post("/v1/audits", json={}, headers=headers).status_code == 202


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "localhost.evil.example", ""]
)
def test_a_name_that_others_may_point_at_us_is_refused(open_client, host):
    answer = open_client.get("/v1/loops", headers={"Host": host})
    assert (answer.status_code, answer.json()["code"]) == (421, "host_not_allowed")


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:8000", "localhost.:8000", "127.0.0.1", "[::1]:8000", "127.8.0.1"]
)
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


@pytest.mark.parametrize("path", ["/healthz", "/readyz"])
def test_probes_need_no_allowed_host_but_the_address_of_the_machine(serve, settings, path):
    behind_proxy = settings.model_copy(update={"allowed_hosts": "plant.example", "require_keys": True})
    with serve(create_app(behind_proxy)) as client:
        for host, status in (
            ("127.0.0.1:8000", 200),
            ("localhost", 200),
            ("[::1]:8000", 200),
            ("172.18.0.5", 200),
            ("plant.example", 200),
            ("evil.example", 421),
            ("", 421),
        ):
            assert client.get(path, headers={"Host": host}).status_code == status


def test_what_does_not_listen_on_loopback_asks_for_keys(serve, tmp_path, make_tables):
    settings = Settings(data_dir=tmp_path)
    make_tables(settings)
    with serve(create_app(settings, keys_required=True)) as client:
        assert client.get("/v1/loops").status_code == 401
        assert client.get("/healthz").status_code == 200


def test_while_the_data_base_is_away_nobody_gets_in_and_it_is_told_as_503(serve, tmp_path):
    address = "postgresql+psycopg://who:secret@127.0.0.1:1/none"
    settings = Settings(data_dir=tmp_path, database_url=address, require_keys=True)
    with serve(create_app(settings)) as client:
        for headers in (bearer(key_text.make(Role.admin).text), {"Cookie": f"loopaudit_session={'a' * 43}"}):
            answer = client.get("/v1/loops", headers=headers)
            assert (answer.status_code, answer.json()["code"]) == (503, "database_away")
            assert answer.headers["retry-after"]
            assert "secret" not in answer.text
        assert client.get("/healthz", headers=headers).status_code == 200


FORWARDED = [
    {"X-Forwarded-For": "203.0.113.9"},
    {"X-Real-IP": "203.0.113.9"},
    {"Forwarded": "for=203.0.113.9"},
    {"Via": "1.1 proxy"},
    {"X-Forwarded-Port": "443"},
]


@pytest.mark.parametrize("headers", FORWARDED)
def test_what_a_proxy_on_this_machine_passes_on_needs_a_key(open_client, headers):
    answer = open_client.get("/v1/loops", headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (401, "key_needed")
    assert open_client.get("/healthz", headers=headers).status_code == 200


def test_what_is_forwarded_is_open_where_that_is_wanted(serve, tmp_path, make_tables):
    settings = Settings(data_dir=tmp_path, allow_open=True)
    make_tables(settings)
    with serve(create_app(settings)) as client:
        assert client.get("/v1/loops", headers=FORWARDED[0]).status_code == 200
