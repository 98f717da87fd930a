"""The reference names every field, code and route, with its meaning: what is new must be written there."""

from pathlib import Path

import pytest
from pydantic import BaseModel

from app.api import models
from app.api.permissions import ROUTES
from app.api.reference import CODES, TABLES, page, shape

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "REFERENCE.md").read_text(encoding="utf-8")
AGAIN = "write it anew: .venv/bin/python -m app.api.reference > docs/REFERENCE.md"
BODIES = {"HealthOut", "Read", "LoopPatch", "NoteIn", "AuditIn", "ReadyOut"}


def test_the_page_is_what_the_models_say():
    assert "".join(page()) == TEXT, AGAIN


@pytest.mark.parametrize(("title", "model"), [(title, model) for title, _, model in TABLES])
def test_every_field_has_a_meaning(title, model):
    part = TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]
    for name, field in model.model_fields.items():
        assert field.description, name
        assert f"| `{name}` | " in part, AGAIN


@pytest.mark.parametrize("words", [words for _, words in CODES], ids=[title for title, _ in CODES])
def test_every_code_is_there(words):
    assert words
    assert all(f"| `{code}` | " in TEXT for code in words), AGAIN


def test_every_route_is_there():
    assert all(f"| `{method} {path.replace(':path', '')}` | " in TEXT for method, path in ROUTES), AGAIN


def test_every_answer_of_the_api_has_its_table():
    answers = {
        name
        for name, model in vars(models).items()
        if isinstance(model, type) and issubclass(model, BaseModel) and model.__module__ == models.__name__
    }
    told = {model.__name__ for _, _, model in TABLES}
    assert {name for name in answers if not name.endswith("Page")} - BODIES <= told


def test_types_are_told_in_words():
    assert [shape(t) for t in (float | None, int, str, list[int], bool)] == [
        "number", "whole number", "text", "list", "true or false"
    ]  # fmt: skip
