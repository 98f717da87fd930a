"""What no route takes: parameters and fields that it does not know, and texts that no database keeps.

Passed over in silence, a misspelt one answers another question.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, get_args, get_origin

from fastapi import Request
from fastapi.dependencies.utils import get_flat_params
from fastapi.exceptions import RequestValidationError
from fastapi.params import Cookie, Header, Path
from fastapi.routing import APIRoute
from pydantic import BaseModel

from app.errors import RequestError, in_our_words
from app.json_texts import DoubledNameError, given_json

JSON_KIND = re.compile(r"application/([\w.-]+\+)?json")


async def only_known(request: Request) -> None:
    """Refuses parameters that the route does not declare, and two values of one that takes one."""
    if not request.query_params:
        return
    known = declared(request.scope["route"])
    unknown = [name for name in request.query_params if name not in known]
    if unknown:
        text = f"no parameter is called so; there is {', '.join(known)}" if known else "this takes no parameters"
        raise RequestValidationError([{"loc": ("query", name), "msg": text} for name in unknown])
    given = Counter(name for name, _ in request.query_params.multi_items())
    wrong = [(name, times) for name, times in given.items() if times > 1 and not takes_several(known[name])]
    if wrong:
        text = "it is given {} times and takes one value"
        raise RequestValidationError([{"loc": ("query", name), "msg": text.format(times)} for name, times in wrong])


async def no_zero_bytes(request: Request) -> None:
    """Refuses a zero byte in whatever is asked, on every route: PostgreSQL has no text with one, and says so by a
    fault. Halves of letters cannot come this far: what is no UTF-8 is replaced where the address is decoded."""
    found = [name for name, value in request.query_params.multi_items() if "\x00" in value]
    if found:
        text = "no text of this service has a zero byte"
        raise RequestValidationError([{"loc": ("query", name), "msg": text} for name in found])


async def json_alone(request: Request) -> None:
    """Refuses a body that says it is something else than JSON: the framework would read its text as one value. And one
    that gives a field twice, of which the framework takes the last."""
    kind = request.headers.get("content-type", "").split(";")[0].strip().lower()
    sent = request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers
    if sent and kind and not JSON_KIND.fullmatch(kind):
        raise RequestError("media_type", f"this takes application/json, not {kind[:60]!r}")
    try:
        given_json(await request.body() or b"{}")
    except DoubledNameError as doubled:
        text = f"it is given {doubled.times} times and takes one value"
        raise RequestValidationError([{"loc": ("body", doubled.name), "msg": text}]) from doubled
    except (ValueError, RecursionError):  # the framework says so itself, or does not read as JSON what has no kind
        return


def declared(route: APIRoute) -> dict[str, Any]:
    """The types of the route's query parameters by name, those of a model one by one: only queries come as models."""
    parameters = get_flat_params(route.dependant)
    asked = (one for one in parameters if not isinstance(one.field_info, Path | Header | Cookie))
    return {one.alias: one.field_info.annotation for one in asked}


def takes_several(kind: Any) -> bool:
    """Whether a parameter of this kind may come several times."""
    return get_origin(kind) in (list, tuple, set) or any(takes_several(part) for part in get_args(kind))


def what_is_wrong(item: Mapping[str, Any], route: Any) -> str:
    """What the framework found wrong, in words: of a field that the body does not have, those that it has; of a body
    that is no JSON, what the place needs that is named."""
    if item.get("type") == "extra_forbidden" and isinstance(route, APIRoute) and route.body_field is not None:
        known = fields_at(item["loc"][1:-1], route.body_field.field_info.annotation)
        return f"no field is called so; there is {', '.join(known)}"
    if item.get("type") == "json_invalid":
        return f"from this character on it is no JSON: {item['ctx']['error']}"
    return in_our_words(str(item["msg"]))


def fields_at(path: Iterable[Any], kind: Any) -> list[str]:
    """The names of the fields of the object at this path of a body of that kind."""
    for name in path:
        found = [field.annotation for model in models_in(kind) for field in by_name(model, name)]
        kind = found[0] if found else kind  # the number of an item in a list names no field
    return [field.alias or name for model in models_in(kind) for name, field in model.model_fields.items()]


def by_name(model: type[BaseModel], name: Any) -> list[Any]:
    return [field for own, field in model.model_fields.items() if name in (own, field.alias)]


def models_in(kind: Any) -> Iterator[type[BaseModel]]:
    """The models that a value of this kind may be, or hold in a list."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    for part in get_args(kind):
        yield from models_in(part)
