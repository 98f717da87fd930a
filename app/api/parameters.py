"""Query parameters that a route does not know: passed over in silence, a misspelt one answers another question."""

from fastapi import Request
from fastapi.dependencies.utils import get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Cookie, Header, Path
from fastapi.routing import APIRoute


async def only_known(request: Request) -> None:
    """Refuses parameters that the route does not declare."""
    if not request.query_params:
        return
    known = declared(request.scope["route"])
    unknown = [name for name in request.query_params if name not in known]
    if unknown:
        text = f"no parameter is called so; there is {', '.join(known)}" if known else "this takes no parameters"
        raise RequestValidationError([{"loc": ("query", name), "msg": text} for name in unknown])


def declared(route: APIRoute) -> tuple[str, ...]:
    """The names of the route's query parameters, those of a model one by one: only queries come as models."""
    parameters = get_flat_params(route.dependant)
    return tuple(one.alias for one in parameters if not isinstance(one.field_info, Path | Header | Cookie))
