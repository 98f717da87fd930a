"""What went wrong, as a page for people: in words, with the code and the request's name, and a way back."""

import re
from collections.abc import Mapping
from typing import Any

from starlette.responses import HTMLResponse

from app.http.problems import LONGEST_ECHO
from app.services.telling.naming import with_capital
from app.web.rendering import page

HEADINGS = {
    400: "This could not be understood",
    401: "A key is needed",
    403: "This is not allowed",
    404: "There is no such page",
    405: "This address does not take that method",
    408: "It took too long to arrive",
    409: "It is too late for that",
    412: "It has changed since",
    413: "This is too large",
    415: "This kind of file cannot be read",
    421: "This service does not answer to that name",
    422: "This could not be used",
    429: "Too many requests",
    500: "Something broke in the service",
    503: "The service is busy or is waiting for its database",
    504: "It is not known whether this was done",
    507: "The disk of the service is full",
}
HEADING_BY_CODE = {
    "unknown_loop": "There is no such loop",
    "unknown_audit": "There is no such run",
    "unknown_upload": "There is no such file",
    "not_audited": "There is no verdict on it yet",
}
NEXT = {
    401: "Log in with a key of yours, or ask whoever runs this service for one.",
    403: "Ask whoever runs this service for a key with the role that this needs.",
    404: "It may have been removed since, or the address is incomplete.",
    405: "Use the button on its page.",
    409: "Reload its page and check its current state.",
    412: "Reload its page and check its current state.",
    421: "Whoever runs this service sets the host names that it answers to.",
    429: "Wait a moment, then send it again unchanged: go back in the browser, what you typed is still there.",
    500: "It is not your fault. Whoever runs the service can find this request in its log by the name below.",
    503: "Try again in a few seconds.",
    504: "Check whether it is there before you ask for it again.",
    507: "Nothing is wrong with what you sent. Tell whoever runs this service that its disk is full.",
}
NEXT_BY_CODE = {
    "csrf_token": "You have logged in again since that page was loaded. Reload it and send the form again.",
    "cross_site": "Open this service by its own address, and send it from its own page.",
    "invalid_key": "Log in with another key, or ask whoever runs this service for one.",
    "unknown_loop": "The tag may be spelled differently: look it up in the table.",
    "not_audited": "The next audit of the plant will bring its verdict.",
    "unknown_audit": "Existing runs are listed under Runs; old ones are not kept.",
    "unknown_upload": "Existing files are listed under Uploads; old ones are not kept.",
    "no_such_route": "The address may be mistyped, or belong to another version of this service.",
}
"""What is said where the status alone would say something else."""
DETAIL_BY_CODE = {"key_needed": "You are not logged in, or your login has ended; nothing was done."}
"""In place of what clients are told, who carry their key in a header."""
TRY_AGAIN = "Go back in the browser: what you typed is still there. Change it and send it again."

ACTION = re.compile(
    r"(/loops/.+)/(?:audit|continues|explanations|notes|notes/[^/]+/(?:withdraw|unshelve)|settings)"
    r"|(/uploads)/kept/forget|(/uploads/[^/]+)/(?:audit|mapping)|(/runs/[^/]+)/cancel|(/runs|/uploads|/loop-list)"
)
"""What a form is sent to, and the page that has it."""
A_WORD = re.compile(r"(?:a|[a-z]{2,})[ ,;](?!=)")


def error_page(problem: Mapping[str, Any]) -> HTMLResponse:
    """`problem`: the fields of the problem that a machine would be told."""
    status, code = int(problem["status"]), problem["code"]
    found = page(
        "error.html",
        heading=HEADING_BY_CODE.get(code) or HEADINGS.get(status, problem["title"]),
        detail=as_sentence(DETAIL_BY_CODE.get(code, problem["detail"])),
        next_step=NEXT_BY_CODE.get(code) or NEXT.get(status, TRY_AGAIN),
        form_page=form_page(problem["instance"]),
        problem=problem,
        request_name=problem.get("request_id"),
    )
    found.status_code = status
    return found


def as_sentence(detail: str) -> str:
    """As it stands on a page; a name that it begins with (pv_low, fic-101, mV, d = 0.3) stays as it is spelled."""
    begun = with_capital(detail) if A_WORD.match(detail) else detail
    return begun if begun.endswith((".", "?", "!")) or not begun else f"{begun}."


def form_page(instance: str) -> str | None:
    """The page of the form that was sent to this path, cut where it is too long to be told; None: there is none."""
    found = ACTION.fullmatch(instance) if len(instance) < LONGEST_ECHO else None
    return next(filter(None, found.groups())) if found else None
