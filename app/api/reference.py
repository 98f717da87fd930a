"""The reference of fields and codes, from the models themselves: `python -m app.api.reference > docs/REFERENCE.md`."""

import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_type_hints

from fastapi.openapi.utils import get_openapi
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from app.api import models
from app.api.explanation_models import ExplanationIn
from app.api.routes import api
from app.http.permissions import ROUTES
from app.services import outward
from app.services.audit_json import models as audit
from app.services.explaining import wording as explanation_wording
from app.services.telling import error_words, wording
from app.services.telling.reason_wording import REASON_WORDS

TABLES: tuple[tuple[str, str, type], ...] = (
    (
        "A row of the reliability table",
        "`GET /v1/reliability`, `/v1/loops/{tag}/verdicts`, CSV",
        audit.ReliabilityRow,
    ),
    (
        "What is written of a loop",
        "with the row in `GET /v1/reliability`, CSV and `GET /v1/loops/{tag}/health`",
        audit.WrittenFields,
    ),
    ("Key figures", "with the row in `GET /v1/loops/{tag}/health`; over good samples only", audit.KeyFiguresLine),
    ("Reasons", "`reasons` of `loopaudit audit --format jsonl`", audit.ReasonLine),
    ("Parts of the health", "`health_parts` of `--format jsonl`", audit.HealthPartLine),
    ("Identification", "`hammerstein` of `--format jsonl`", audit.HammersteinLine),
    ("Rivals", "`rivals` of `--format jsonl`", audit.RivalLine),
    ("Spells", "`episodes` of `--format jsonl`", audit.EpisodeLine),
    ("A loop", "`GET /v1/loops`", outward.LoopOut),
    ("A change of a loop", "body of `PATCH /v1/loops/{tag}`", models.LoopPatch),
    ("A list of loops taken", "`PATCH /v1/loops`", outward.LoopsChangedOut),
    ("A trend", "`GET /v1/loops/{tag}/trend`", outward.TrendOut),
    ("A note", "`GET /v1/loops/{tag}/notes`", outward.NoteOut),
    ("A note to write", "body of `POST /v1/loops/{tag}/notes`", models.NoteIn),
    ("An upload in the list", "`GET /v1/uploads`", outward.UploadListed),
    ("An upload", "`GET /v1/uploads/{id}`", outward.UploadOut),
    ("A refused row", "`rejects` of an upload", outward.RejectOut),
    ("A run to start", "body of `POST /v1/audits`", models.AuditIn),
    ("A run", "`GET /v1/audits/{id}`", outward.AuditOut),
    ("A failed loop", "`failures` of a run", outward.FailureOut),
    ("A night of the plant", "`GET /v1/nights`", outward.NightOut),
    ("A unit in a night", "`units` of a night", outward.NightOfUnitOut),
    ("A group", "`GET /v1/groups`", outward.GroupOut),
    ("A member of a group", "`members` of a group", outward.GroupMemberOut),
    ("A question for an explanation", "body of `POST /v1/loops/{tag}/explanations`", ExplanationIn),
    ("A row of the trail", "`GET /v1/trail`", outward.TrailRowOut),
)
SAID = "Stable codes, and what the pages say for them."
WINDOWS = "`windows` and `held_out`, in s from the start of the recording, end before their second number."
COMMANDS = "on the command line in brackets at the end of the line."
CODES: tuple[tuple[str, str, Mapping[str, str]], ...] = (
    ("Verdicts", SAID, wording.VERDICT_WORDS),
    ("Reliability", SAID, wording.RELIABILITY_WORDS),
    ("Likely causes, and explanations that compete with stiction", SAID, wording.CAUSE_WORDS),
    (
        "Codes of the reasons",
        "`reasons` of a verdict, and the checks of its data and of its size. A competing explanation is a reason "
        "too where it stands out, by its code above; x is what was measured.",
        REASON_WORDS,
    ),
    ("Verdicts of an explanation", SAID, explanation_wording.VERDICT_WORDS),
    ("Effects that a simulation lacks", f"{SAID} {WINDOWS}", explanation_wording.EFFECT_WORDS),
    ("Evidence of an explanation", "`evidence` of `loopaudit explain`.", explanation_wording.EVIDENCE_WORDS),
    (
        "Codes of refused requests",
        "`code` of a problem, with which HTTP answers whatever it refuses, and of `refused` in a list of loops taken; "
        f"{COMMANDS} `http_` before a status: one that has no code of its own.",
        error_words.REFUSED_WORDS,
    ),
    (
        "Codes of refused files",
        f"`error_code` of an upload that failed (so is `fault`, of the failed loops), or of a problem; {COMMANDS}",
        error_words.FILE_WORDS,
    ),
    (
        "Codes of refused rows",
        "`code` in `rejects` of an upload, and `reject_counts`; `loopaudit inspect` and `upload` show them.",
        error_words.REJECT_WORDS,
    ),
    (
        "Codes of what cannot be compared or simulated",
        "`code` of a problem where an explanation is asked for, `error_code` of one that failed; `loopaudit explain` "
        "and `simulate`.",
        error_words.COMPARED_WORDS,
    ),
    (
        "Codes of failed loops",
        "`code` in `failures` of a run, `error_code` of an explanation that failed, and what the engine raises where "
        "a recording cannot be audited.",
        error_words.LOOP_WORDS,
    ),
    ("Codes of the command line", f"Beside those above; {COMMANDS}", error_words.COMMAND_WORDS),
)


WORDS = (
    ("list", "list"),
    ("tuple", "list"),
    ("dict", "object"),
    ("datetime", "time"),
    ("bool", "true or false"),
    ("float", "number"),
    ("int", "whole number"),
    ("str", "text"),
    ("Literal", "code"),
)
"""What JSON calls a type, by the first of these that its name has in it."""


def page() -> Iterator[str]:
    yield "# Fields, codes and routes\n\n"
    yield "Written by `python -m app.api.reference` from the models; `/openapi.json` says the same to machines.\n"
    yield "Null means: not known, or not to be had from this record.\n"
    for title, where, model in TABLES:
        yield from section(title, where, described(model))
    for title, where, words in CODES:
        yield from section(title, where, words.items())
    for route, told in asked():
        yield from section(f"Parameters of `{route}`", "In the query.", told)
    yield from section("Routes", "`open`: without a key. A role may do what `read` may, and what names it.", roles())


def section(title: str, where: str, rows: Iterable[tuple[str, str]]) -> Iterator[str]:
    yield f"\n## {title}\n\n{where}\n\n| name | meaning |\n|---|---|\n"
    for name, meaning in rows:
        safe = meaning.replace("|", "\\|")
        yield f"| `{name}` | {safe} |\n"


def described(model: type) -> Iterator[tuple[str, str]]:
    for name, field in fields_of(model).items():
        yield name, f"{field.description} ({shape(field.annotation)})"


def fields_of(model: type) -> dict[str, FieldInfo]:
    """Of a model, or of a dataclass whose fields are described."""
    if issubclass(model, BaseModel):
        return model.model_fields
    return {name: FieldInfo.from_annotation(told) for name, told in get_type_hints(model, include_extras=True).items()}


def shape(annotation: Any) -> str:
    """number, text, ... as JSON calls it, from the type."""
    text = getattr(annotation, "__name__", "") if isinstance(annotation, type) else str(annotation)
    for part, word in WORDS:
        if part in text:
            return word
    return "object"


def asked() -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """The routes that take parameters, with their names and meanings."""
    paths = get_openapi(title="", version="", routes=api().routes)["paths"]
    for path, operations in sorted(paths.items()):
        for method, operation in operations.items():
            told = [(one["name"], limited(one)) for one in operation.get("parameters", ()) if one["in"] == "query"]
            if told:
                yield f"{method.upper()} {path}", told


def limited(parameter: dict[str, Any]) -> str:
    """What it means, and what it is where it is left out."""
    default = parameter["schema"].get("default")
    return parameter["description"] + ("" if default in (None, "", []) else f" Without it: {default}.")


def roles() -> Iterator[tuple[str, str]]:
    for (method, path), permission in sorted(ROUTES.items(), key=lambda item: (item[0][1], item[0][0])):
        needs = "open" if permission.needs is None else str(permission.needs.value)
        yield f"{method} {path.replace(':path', '')}", needs


if __name__ == "__main__":
    sys.stdout.writelines(page())
