"""Query parameters that no route takes: those that it does not know, and texts that no data base keeps.

Passed over in silence, a misspelt one answers another question.
"""

import re

from fastapi import Request
from fastapi.dependencies.utils import get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Cookie, Header, Path
from fastapi.routing import APIRoute

from app.errors import RequestError

JSON_KIND = re.compile(r"application/([\w.-]+\+)?json")


async def only_known(request: Request) -> None:
    """Refuses parameters that the route does not declare."""
    if not request.query_params:
        return
    known = declared(request.scope["route"])
    unknown = [name for name in request.query_params if name not in known]
    if unknown:
        text = f"no parameter is called so; there is {', '.join(known)}" if known else "this takes no parameters"
        raise RequestValidationError([{"loc": ("query", name), "msg": text} for name in unknown])


async def no_zero_bytes(request: Request) -> None:
    """Refuses a zero byte in whatever is asked, on every route: PostgreSQL has no text with one, and says so by a
    fault. Halves of letters cannot come this far: what is no UTF-8 is replaced where the address is decoded."""
    found = [name for name, value in request.query_params.multi_items() if "\x00" in value]
    if found:
        text = "no text of this service has a zero byte"
        raise RequestValidationError([{"loc": ("query", name), "msg": text} for name in found])


async def json_alone(request: Request) -> None:
    """Refuses a body that says it is something else than JSON: the framework would read its text as one value."""
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    sent = request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers
    if sent and kind and not JSON_KIND.fullmatch(kind):
        raise RequestError("media_type", f"this takes application/json, not {kind[:60]!r}")


def declared(route: APIRoute) -> tuple[str, ...]:
    """The names of the route's query parameters, those of a model one by one: only queries come as models."""
    parameters = get_flat_params(route.dependant)
    return tuple(one.alias for one in parameters if not isinstance(one.field_info, Path | Header | Cookie))
