"""A service that asks for keys, a key of each role, and a browser."""

import re
from collections.abc import Iterator
from datetime import timedelta

import httpx
import pytest

from app.main import create_app
from app.services.access import keys
from app.services.access.identity import Role
from app.services.backend import Backend
from app.settings import Settings
from tests.conftest import authorities


@pytest.fixture(scope="module")
def backend(open_plant) -> Backend:
    return open_plant(key_recheck_s=0, require_keys=True)


@pytest.fixture(scope="module")
def settings(backend) -> Settings:
    return backend.settings


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
    headers = {"Sec-Fetch-Site": "same-origin"}
    with httpx.Client(base_url=client.base_url, headers=headers, verify=authorities()) as connection:
        yield connection


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def logged_in(browser: httpx.Client, key: str) -> str:
    """Logs in; the token that the forms of the page carry."""
    answer = browser.post("/login", data={"key": key, "next": "/"})
    assert answer.status_code == 303, answer.text
    return re.search(r'name="csrf-token" content="([\w-]{43})"', browser.get("/").text)[1]
