"""Requests that a fuzzer once found, as `make fuzz` writes them, with the status that they are answered with now; on
both data bases, because PostgreSQL refuses texts that SQLite takes."""

import asyncio
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from tests.conftest import empty_tables
from tests.fuzz.api import Judge, ask
from tests.fuzz.plant import Plant, app_of, build
from tests.fuzz.requests import Asked

FOUND = sorted((Path(__file__).parents[1] / "corpus" / "api").iterdir())


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
