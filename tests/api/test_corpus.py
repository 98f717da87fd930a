"""Requests that a fuzzer once found, as `make fuzz` writes them, with the status that they are answered with now."""

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from app.main import create_app
from app.services.access.authentication import Authenticator
from tests.fuzz.api import Judge, ask
from tests.fuzz.plant import build
from tests.fuzz.requests import Asked

FOUND = sorted((Path(__file__).parents[1] / "corpus" / "api").iterdir())


@pytest.fixture(scope="module")
def judge_and_key(tmp_path_factory, warm_kernels) -> tuple[Judge, str]:
    plant = build(tmp_path_factory.mktemp("fuzzed"))
    app = create_app(plant.settings)
    app.state.backend, app.state.access = plant.backend, Authenticator(plant.backend)
    return Judge(app, tmp_path_factory.mktemp("found")), plant.keys["admin"]


def asked(find: dict[str, Any], key: str) -> Asked:
    """The request; its key was left out where it was written down."""
    given = {name: value for name, value in find["headers"]} | {"authorization": f"Bearer {key}"}
    headers = [(name.encode("latin-1"), value.encode("latin-1")) for name, value in given.items()]
    path, query, body = (find[name].encode("latin-1") for name in ("raw_path", "query", "body"))
    return Asked(find["method"], find["raw_path"], path, query, headers, body)


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.stem)
def test_what_was_once_found_stays_mended(judge_and_key, path: Path) -> None:
    judge, key = judge_and_key
    find = json.loads(path.read_text("utf-8"))
    judge.statuses.clear()
    judge.finds.clear()
    asyncio.run(ask(judge, asked(find, key)))
    assert judge.finds == {}
    assert list(judge.statuses) == [find["answered"]]
