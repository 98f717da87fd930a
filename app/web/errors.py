"""What went wrong, as a page for people: in words, with the code and the request's name, and a way back."""

from collections.abc import Mapping
from typing import Any

from starlette.responses import HTMLResponse

from app.web.rendering import page

HEADINGS = {
    400: "This could not be understood",
    401: "A key is needed",
    403: "This is not allowed",
    404: "There is no such page",
    405: "This address cannot be asked that way",
    408: "It took too long to arrive",
    409: "It is too late for that",
    413: "This is too large",
    415: "This kind of file is not read",
    421: "This service does not answer to that name",
    422: "This could not be used",
    429: "Too many requests",
    500: "Something broke in the service",
    503: "The service is busy or waits for its data base",
    504: "It is not known whether this was done",
    507: "The disk of the service is full",
}
NEXT = {
    401: "Log in with a key of yours, or ask whoever runs this service for one.",
    403: "Ask whoever runs this service for a key with the role that this needs.",
    404: "The tag may be spelled in another way: look it up in the table.",
    405: "Come from the page that has the button for it.",
    500: "It is not your fault. Whoever runs the service finds this request in its log, by the name below.",
    503: "Try again in a few seconds.",
    504: "Look whether it is there before you ask for it again.",
}
TRY_AGAIN = "Go back in the browser: what you typed is still there. Change it and send it again."


def error_page(problem: Mapping[str, Any]) -> HTMLResponse:
    """`problem`: the fields of the problem that a machine would be told."""
    status = int(problem["status"])
    found = page(
        "error.html",
        heading=HEADINGS.get(status, problem["title"]),
        next_step=NEXT.get(status, TRY_AGAIN),
        problem=problem,
        request_name=problem.get("request_id"),
    )
    found.status_code = status
    return found
