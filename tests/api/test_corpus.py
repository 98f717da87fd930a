"""Requests that a fuzzer once found, as `make fuzz` writes them, with the status that they are answered with now; and
a few hundred new ones. On both databases: PostgreSQL refuses texts that SQLite takes."""

import asyncio
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from app.services.access.trail import list_trail
from tests.conftest import empty_tables
from tests.fuzz.api import Judge, ask, settle_uploads
from tests.fuzz.plant import Plant, app_of, build
from tests.fuzz.requests import Asked, Requests

FOUND = sorted((Path(__file__).parents[1] / "corpus" / "api").iterdir())
NEW, NEW_SEED = 400, 7


@dataclass(frozen=True)
class Fuzzed:
    plant: Plant
    app: FastAPI
    judge: Judge


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def fuzzed(request, tmp_path_factory, warm_kernels) -> Iterator[Fuzzed]:
    url = ""
    if request.param == "postgresql":
        url = request.getfixturevalue("postgres_url")
        empty_tables(url)
    plant = build(tmp_path_factory.mktemp("fuzzed"), url)
    app = app_of(plant)
    yield Fuzzed(plant, app, Judge(app, tmp_path_factory.mktemp("found")))
    plant.backend.close()


def asked(find: dict[str, Any], key: str) -> Asked:
    """The request; its key was left out where it was written down."""
    given = {name: value for name, value in find["headers"]} | {"authorization": f"Bearer {key}"}
    headers = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in given.items()]
    path, query, body = (find[name].encode("latin-1") for name in ("raw_path", "query", "body"))
    return Asked(find["method"], find["raw_path"], path, query, headers, body)


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_what_was_once_found_stays_mended(fuzzed: Fuzzed, path: Path) -> None:
    find = json.loads(path.read_text("utf-8"))
    fuzzed.judge.statuses.clear()
    fuzzed.judge.finds.clear()
    asyncio.run(ask(fuzzed.judge, asked(find, fuzzed.plant.keys["admin"])))
    assert fuzzed.judge.finds == {}
    assert list(fuzzed.judge.statuses) == [find["answered"]]


def test_new_requests_find_nothing(fuzzed: Fuzzed) -> None:
    requests = Requests(fuzzed.app.openapi(), fuzzed.plant.keys, fuzzed.plant.tags, seed=NEW_SEED)
    access = fuzzed.app.state.access
    session = access.open_session(access.key(fuzzed.plant.keys["admin"]))
    requests.session = session.token, session.identity.form_token
    fuzzed.judge.finds.clear()

    async def all_of_them() -> None:
        for _ in range(NEW):
            await ask(fuzzed.judge, requests.next())

    asyncio.run(all_of_them())
    settle_uploads(fuzzed.plant, fuzzed.judge)
    assert fuzzed.judge.finds == {}


def test_a_stranger_is_refused_on_any_path_and_that_is_noted(fuzzed: Fuzzed) -> None:
    wrong = Asked("PATCH", "", b"/v1/loops/a%00b", headers=[(b"host", b"localhost"), (b"x-api-key", b"la_wrong")])
    fuzzed.judge.statuses.clear()
    asyncio.run(ask(fuzzed.judge, wrong))
    assert list(fuzzed.judge.statuses) == [401]
    noted = list_trail(fuzzed.plant.backend, who="nobody", action="loop.change").rows[0]
    assert (noted.subject, noted.outcome) == ("/v1/loops/a%00b", "refused")
