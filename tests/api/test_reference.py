"""The reference names every field, code and route, with its meaning: what is new must be written there."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from app.api import models
from app.api.reference import CODES, TABLES, fields_of, page, shape
from app.engine.audit import audit
from app.engine.codes import Cause, EvidenceCode, ReasonCode
from app.engine.fitness.assess import LATER_CHECKS
from app.engine.fitness.checks import BLOCKING
from app.engine.judged import SPOILED_BY
from app.engine.recording import Recording
from app.engine.reference.published_rule import READINGS
from app.engine.verdict.wording import WORDED
from app.http.permissions import ROUTES
from app.services import outward
from app.services.explaining.wording import EVIDENCE_WORDS
from app.services.telling.reason_wording import REASON_WORDS
from app.services.telling.wording import CAUSE_WORDS

ROOT = Path(__file__).resolve().parents[2]
ENGINE = ROOT / "app" / "engine"
EXPLAINING = (ENGINE / "mismatch", ROOT / "app" / "services" / "explaining")
IDENTIFICATION = (ENGINE / "armax", ENGINE / "reference" / "hammerstein.py", ENGINE / "reference" / "yper.py")
TEXT = (ROOT / "docs" / "REFERENCE.md").read_text(encoding="utf-8")
AGAIN = "write it anew: .venv/bin/python -m app.api.reference > docs/REFERENCE.md"
BODIES = {"HealthOut", "ReadyOut"}


def test_the_page_is_what_the_models_say():
    assert "".join(page()) == TEXT, AGAIN


@pytest.mark.parametrize(("title", "model"), [(title, model) for title, _, model in TABLES])
def test_every_field_has_a_meaning(title, model):
    part = TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]
    for name, field in fields_of(model).items():
        assert field.description, name
        assert f"| `{name}` | " in part, AGAIN


@pytest.mark.parametrize("words", [words for *_, words in CODES], ids=[title for title, *_ in CODES])
def test_every_code_is_there(words):
    assert words
    assert all(f"| `{code}` | " in TEXT for code in words), AGAIN


def test_every_route_is_there():
    assert all(f"| `{method} {path.replace(':path', '')}` | " in TEXT for method, path in ROUTES), AGAIN


def test_every_answer_of_the_api_has_its_table():
    answers = {
        name
        for where in (models, outward)
        for name, model in vars(where).items()
        if isinstance(model, type) and model.__module__ == where.__name__
    }
    told = {model.__name__ for _, _, model in TABLES}
    assert {name for name in answers if not name.endswith("Page")} - BODIES <= told


def test_types_are_told_in_words():
    assert [shape(t) for t in (float | None, int, str, list[int], bool)] == [
        "number", "whole number", "text", "list", "true or false"
    ]  # fmt: skip


def codes_made(where: Path, *makers: str) -> Iterator[str]:
    """The codes that calls of `makers` are given: as they stand, or a pattern for one that is put together."""
    for path in where.rglob("*.py") if where.is_dir() else {where} & {where.with_suffix(".py")}:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in makers and node.args:
                yield from patterns(node.args[0])


def patterns(code: ast.expr) -> Iterator[str]:
    if isinstance(code, ast.Constant) and isinstance(code.value, str):
        yield re.escape(code.value)
    if isinstance(code, ast.JoinedStr):
        yield "".join(re.escape(p.value) if isinstance(p, ast.Constant) else ".+" for p in code.values)


def unlisted(made: set[str], words: dict[str, str]) -> set[str]:
    return {pattern for pattern in made if not any(re.fullmatch(pattern, code) for code in words)}


def test_every_reason_that_the_engine_makes_has_a_meaning():
    rooms = {*ENGINE.iterdir()} - {ENGINE / "mismatch", ENGINE / "rivals"}
    made = {code for room in rooms for code in codes_made(room, "Reason", "Finding", "_finding", "not_evaluated")}
    made |= {code for part in IDENTIFICATION for code in codes_made(part, "DataError")}
    assert {"same_signal", "size_width", "record_too_short"} <= made
    assert unlisted(made, REASON_WORDS) == set()


def test_the_types_of_codes_know_the_codes_that_have_a_meaning_and_no_others():
    shapes = {f"shape_{name}" for name in WORDED}
    assert {*get_args(ReasonCode), *shapes} == {*REASON_WORDS, *get_args(Cause)}
    assert set(get_args(Cause)) <= set(CAUSE_WORDS)
    assert set(get_args(EvidenceCode)) == set(EVIDENCE_WORDS)


def test_every_code_that_is_put_together_has_a_meaning():
    shapes = {f"shape_{name}" for name in WORDED}
    assert shapes | {f"yper_{reading}" for reading in READINGS} | BLOCKING | {*LATER_CHECKS} <= set(REASON_WORDS)
    assert not any("{" in meaning for meaning in REASON_WORDS.values())


def test_every_cause_has_a_meaning():
    made = set(codes_made(ENGINE / "rivals", "Rival", "not_evaluated"))
    assert "tight_tuning" in made
    assert unlisted(made | set(SPOILED_BY.values()), CAUSE_WORDS) == set()


def test_every_piece_of_evidence_of_an_explanation_has_a_meaning():
    made = {code for where in EXPLAINING for code in codes_made(where, "Reason")}
    assert unlisted(made, EVIDENCE_WORDS) == set()


def loop(pv: np.ndarray, op: np.ndarray, automatic: np.ndarray | None = None) -> Recording:
    return Recording("loop", np.arange(len(pv), dtype=float), pv, op, sp=np.full(len(pv), 0.5), automatic=automatic)


def test_what_audits_say_is_in_the_reference():
    t, rng = np.arange(600.0), np.random.default_rng(3)
    noise, square = rng.normal(size=(2, 600)), np.sign(np.sin(2 * np.pi * t / 50))
    sticky = 0.1 * np.cumsum(square) + 0.02 * noise[0]
    ramps = np.arcsin(np.sin(2 * np.pi * (t - 12.5) / 50))
    recordings = (
        loop(sticky, ramps),
        loop(*noise),
        loop(np.sin(t / 9), np.cos(t / 9)),
        loop(np.zeros(600), ramps, np.ones(600, dtype=bool)),
        loop(sticky, np.zeros(600)),
        loop(sticky, ramps, np.zeros(600, dtype=bool)),
        loop(sticky[:40], ramps[:40]),
        loop(np.round(sticky), np.clip(ramps, -0.2, 0.2)),
    )
    said = {reason.code for recording in recordings for reason in audit(recording).judgement.reasons}
    assert {"not_in_automatic", "pv_does_not_answer", "published_methods", "too_short"} <= said
    assert said <= {*REASON_WORDS, *CAUSE_WORDS}
