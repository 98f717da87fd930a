"""Templates and what they may call. Everything that comes from a plant is escaped."""

from pathlib import Path
from typing import Any

import plotly
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from starlette.responses import HTMLResponse

from app.kernel_cache import compiling
from app.services.access.identity import Identity, Role, current
from app.services.addresses import tag_in_url
from app.services.moments import PlantClock
from app.services.outward import UploadOut
from app.services.rendering import FILTERS, GLOBALS
from app.services.telling.wording import FILE_UNSEEN, NO_ROOM_YET, READ_IN_PART, STATE_WORDS

HERE = Path(__file__).parent
STATIC = HERE / "static"
CHARTS = Path(plotly.__file__).parent / "package_data" / "plotly.min.js"
SIGNALS = ("pv", "op", "sp", "mode")


def words(code: str) -> str:
    return code.replace("_", " ")


def other_way(sort: str) -> str:
    return sort.removeprefix("-") if sort.startswith("-") else f"-{sort}"


def as_tags(loops: list[dict[str, Any]]) -> list[tuple[str, str, str]]:
    """(tag, loop, signal) of what an upload was understood to hold."""
    return [
        (tag, loop["loop"], name.upper() if name in SIGNALS else "OTHER")
        for loop in loops
        for name, tag in [*((n, loop.get(n)) for n in SIGNALS), *(("other", other) for other in loop["others"])]
        if tag
    ]


def upload_words(upload: UploadOut) -> str:
    if upload.waits_for_room_since:
        return NO_ROOM_YET
    if upload.waits_for_file_since:
        return FILE_UNSEEN
    return READ_IN_PART if upload.damaged else STATE_WORDS[upload.state]


def environment() -> Environment:
    templates = Environment(loader=FileSystemLoader(HERE / "templates"), autoescape=True, undefined=StrictUndefined)
    templates.filters |= FILTERS | {
        "tag_in_url": tag_in_url,
        "upload_words": upload_words,
        "words": words,
        "other_way": other_way,
        "as_tags": as_tags,
    }
    templates.globals |= GLOBALS | {"state_words": STATE_WORDS}
    templates.globals |= {"compiling": compiling}
    templates.globals |= {"csrf_field": csrf_field, "csrf_token": csrf_token, "may": may, "logged_in": logged_in}
    return templates


def csrf_token() -> str:
    """What a form or a script of this page sends along (X-CSRF-Token); empty where there is no session."""
    identity = current.get()
    return identity.form_token if identity else ""


def csrf_field() -> Markup:
    """The first thing in every form that changes something."""
    return Markup('<input type="hidden" name="csrf_token" value="{}">').format(csrf_token())


def may(role: str) -> bool:
    """Whether whoever looks at the page may do what needs this role."""
    identity = current.get()
    return identity is not None and identity.may(Role(role))


def logged_in() -> Identity | None:
    """Who looks at the page, where it was a login that said so."""
    identity = current.get()
    return identity if identity and identity.via == "session" else None


TEMPLATES = environment()


def page(name: str, clock: PlantClock | None = None, **values: Any) -> HTMLResponse:
    """`clock`: what times are told by; a page without one tells none."""
    return HTMLResponse(TEMPLATES.get_template(name).render(clock=clock, **values))
