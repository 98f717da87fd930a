"""Every route and who may call it. A route that is not listed here is refused to everyone, and fails a test.

`needs` None is open to all. What is not a GET has an `action`: the name under which the trail keeps it.
"""

import re
from dataclasses import dataclass
from typing import Any

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.routing import Mount, compile_path, get_route_path
from starlette.types import Scope

from app.services.access.identity import Role

READING = ("GET", "HEAD")
PROBES = frozenset({"/healthz", "/readyz"})
UNGUARDED = frozenset({"websocket or the like"})

# What is never deleted, and what is done instead, by path; the first that fits holds.
INSTEAD_OF_DELETING = (
    (
        re.compile(r"/v1/loops/.+/notes/[^/]+"),
        "a note is kept for ever; DELETE .../{id}/repair withdraws the repair that it states, .../{id}/shelving ends "
        "its shelving",
    ),
    (
        re.compile(r"/v1/loops/(?!.+/(?:explanations|health|notes|report|trend|verdicts)(?:/|$)).+"),
        'a loop is kept with its history; PATCH it with {"retired": true}',
    ),
    (re.compile(r"/v1/audits/[^/]+"), "a run is kept; POST .../{id}/cancel stops it"),
)


SECOND_ONE = frozenset({"audit.start", "explanation.ask", "note.write"})
"""Actions that are done a second time when they are asked for once more; of any other that changes nothing."""

IN_STEPS = frozenset({"audit.cancel"})
"""Actions of which a part stays where what comes after it fails."""


@dataclass(frozen=True)
class Permission:
    """`page`: for people, who are led to the login instead of being told 401."""

    needs: Role | None = None
    action: str = ""
    page: bool = False


OPEN = Permission()
OPEN_PAGE = Permission(page=True)
READ = Permission(Role.read)
PAGE = Permission(Role.read, page=True)
ADMIN = Permission(Role.admin)
LOGIN = Permission(None, "session.open", page=True)


def uploads(action: str, page: bool = False) -> Permission:
    return Permission(Role.upload, action, page)


def audits(action: str, page: bool = False) -> Permission:
    return Permission(Role.audit, action, page)


ROUTES: dict[tuple[str, str], Permission] = {
    # For whoever runs the service
    ("GET", "/healthz"): OPEN,
    ("GET", "/readyz"): OPEN,
    ("GET", "/metrics"): READ,
    ("GET", "/openapi.json"): READ,
    ("GET", "/v1/trail"): ADMIN,
    # Uploads
    ("POST", "/v1/uploads"): uploads("upload.receive"),
    ("GET", "/v1/uploads"): READ,
    ("GET", "/v1/uploads/{upload_id}"): READ,
    # Loops
    ("GET", "/v1/loops"): READ,
    ("PATCH", "/v1/loops"): audits("loops.change"),
    ("GET", "/v1/loops/{tag:path}/health"): READ,
    ("GET", "/v1/loops/{tag:path}/verdicts"): READ,
    ("GET", "/v1/loops/{tag:path}/trend"): READ,
    ("POST", "/v1/loops/{tag:path}/explanations"): audits("explanation.ask"),
    ("GET", "/v1/loops/{tag:path}/explanations"): READ,
    ("GET", "/v1/loops/{tag:path}/explanations/{explanation_id}"): READ,
    ("GET", "/v1/loops/{tag:path}/explanations/{explanation_id}/trace"): READ,
    ("GET", "/v1/loops/{tag:path}/explanations/{explanation_id}/plot"): READ,
    ("GET", "/v1/loops/{tag:path}/notes"): READ,
    ("POST", "/v1/loops/{tag:path}/notes"): audits("note.write"),
    ("DELETE", "/v1/loops/{tag:path}/notes/{note_id}/repair"): audits("repair.withdraw"),
    ("DELETE", "/v1/loops/{tag:path}/notes/{note_id}/shelving"): audits("shelving.withdraw"),
    ("GET", "/v1/loops/{tag:path}/report"): READ,
    ("GET", "/v1/report"): READ,
    ("GET", "/v1/reports"): READ,
    ("GET", "/v1/nights"): READ,
    ("GET", "/v1/loops/{tag:path}"): READ,
    ("PATCH", "/v1/loops/{tag:path}"): audits("loop.change"),
    # The table, and audits
    ("GET", "/v1/reliability"): READ,
    ("POST", "/v1/audits"): audits("audit.start"),
    ("POST", "/v1/audits/{audit_id}/cancel"): audits("audit.cancel"),
    ("GET", "/v1/audits"): READ,
    ("GET", "/v1/groups"): READ,
    ("GET", "/v1/audits/{audit_id}/events"): READ,
    ("GET", "/v1/audits/{audit_id}"): READ,
    # Pages
    ("GET", "/"): PAGE,
    ("POST", "/loops/{tag:path}/explanations"): audits("explanation.ask", page=True),
    ("GET", "/loops/{tag:path}/explanation"): PAGE,
    ("GET", "/plant/tiles"): READ,
    ("GET", "/plant/course"): PAGE,
    ("GET", "/table"): PAGE,
    ("GET", "/groups"): PAGE,
    ("GET", "/nights"): PAGE,
    ("GET", "/glossary"): PAGE,
    ("GET", "/loop-list"): PAGE,
    ("POST", "/loop-list"): audits("loops.change", page=True),
    ("GET", "/loops/{tag:path}"): PAGE,
    ("GET", "/loops/{tag:path}/charts"): READ,
    ("POST", "/loops/{tag:path}/audit"): audits("audit.start", page=True),
    ("POST", "/loops/{tag:path}/notes"): audits("note.write", page=True),
    ("POST", "/loops/{tag:path}/notes/{note_id}/withdraw"): audits("repair.withdraw", page=True),
    ("POST", "/loops/{tag:path}/notes/{note_id}/unshelve"): audits("shelving.withdraw", page=True),
    ("POST", "/loops/{tag:path}/continues"): audits("loop.change", page=True),
    ("POST", "/loops/{tag:path}/settings"): audits("loop.change", page=True),
    ("GET", "/runs"): PAGE,
    ("POST", "/runs"): audits("audit.start", page=True),
    ("POST", "/runs/{audit_id}/cancel"): audits("audit.cancel", page=True),
    ("GET", "/runs/{audit_id}"): PAGE,
    ("GET", "/uploads"): PAGE,
    ("POST", "/uploads"): uploads("upload.receive", page=True),
    ("GET", "/uploads/{upload_id}"): PAGE,
    ("POST", "/uploads/{upload_id}/mapping"): uploads("upload.receive", page=True),
    ("POST", "/uploads/kept/forget"): uploads("tag.forget", page=True),
    ("POST", "/uploads/{upload_id}/audit"): audits("audit.start", page=True),
    ("GET", "/login"): OPEN_PAGE,
    ("POST", "/login"): LOGIN,
    ("POST", "/logout"): Permission(None, "session.close", page=True),
    ("GET", "/static/plotly.min.js"): OPEN,
    ("GET", "/static/{path:path}"): OPEN,
}


@dataclass(frozen=True)
class Matched:
    """The route that will answer, who may call it (None: it is not listed), and what the path holds."""

    path: str
    permission: Permission | None
    values: dict[str, str]


class Routes:
    """The app's own routes in its own order, each with its permission: what is matched here is what answers."""

    def __init__(self, app: FastAPI) -> None:
        self._routes = [(compile_path(path)[0], path, methods) for path, methods in listed(app)]

    def match(self, scope: Scope) -> Matched | None:
        """None where no route answers."""
        for pattern, path, methods in self._routes:
            found = pattern.match(get_route_path(scope))
            if found and scope["method"] in methods:
                return Matched(path, ROUTES.get((reading(scope["method"]), path)), found.groupdict())
        return None

    def methods(self, scope: Scope) -> set[str]:
        """All that the path takes, of whichever route; none where there is no such path."""
        taking = (methods for pattern, _, methods in self._routes if pattern.match(get_route_path(scope)))
        found = set().union(*taking)
        return found | set(READING) if "GET" in found else found


def instead(method: str, path: str) -> str:
    """What to do in place of what no address takes, as the end of a sentence; empty where nothing is known."""
    told = (text for pattern, text in INSTEAD_OF_DELETING if method == "DELETE" and pattern.fullmatch(path))
    return next((f"; {text}" for text in told), "")


def listed(app: FastAPI) -> list[tuple[str, frozenset[str]]]:
    """Every path template of the app with its methods, in the order in which the app tries them."""
    return [described(context) for context in iter_route_contexts(app.routes)]


def described(context: Any) -> tuple[str, frozenset[str]]:
    path: str = context.path
    if isinstance(context.original_route, Mount):
        return f"{path}/{{path:path}}", frozenset(READING)
    return path, frozenset(context.methods or UNGUARDED)


def reading(method: str) -> str:
    """HEAD is a GET without its body."""
    return "GET" if method in READING else method
