"""A plant without any loops yet: who asks for its audit learns that there was nothing to audit, and what to do."""

from collections.abc import Iterator

import httpx
import pytest

from app.client import Audit
from app.main import create_app
from app.services.backend import Backend


@pytest.fixture(scope="module")
def client(open_plant, serve) -> Iterator[httpx.Client]:
    backend: Backend = open_plant()
    with serve(create_app(backend.settings)) as connection:
        yield connection


def test_its_run_is_done_and_says_why_it_audited_nothing(client: httpx.Client) -> None:
    answer = client.post("/v1/audits")
    run = Audit.of(answer.json())
    assert (answer.status_code, run.state, run.total, run.code) == (202, "done", 0, "no_loops")
    assert run.text
    assert client.get(answer.headers["location"]).json() == answer.json()
    assert answer.json() in client.get("/v1/audits").json()["rows"]


def test_the_page_of_its_run_says_so_too(client: httpx.Client) -> None:
    page = client.get(client.post("/runs").headers["location"]).text
    assert "No loop with samples was known when it began; send an export" in page
