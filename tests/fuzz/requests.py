"""Requests for every route, half of each as its schema wants it and half hostile; a seed makes the same ones again."""

import json
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote, urlencode

from app.http.permissions import ROUTES
from tests.fuzz import hostile
from tests.fuzz.seeds import seeds

# Fields of forms and queries of the pages, which no schema lists.
PAGES_QUERY = (
    "search",
    "unit",
    "no_unit",
    "owner",
    "verdict",
    "reliability",
    "likely_cause",
    "open_order",
    "health_class",
    "audit_id",
    "sort",
    "cursor",
    "column",
    "next",
)
PAGES_FORM = (
    *(
        "key",
        "next",
        "text",
        "work_order",
        "repaired_at",
        "shelved_until",
        "importance",
        "unit",
        "type",
        "description",
        "owner",
        "pv_unit",
    ),
    *("pv_low", "pv_high", "op_low", "op_high", "mapping", "file"),
)
COLUMNS = ("loop", "priority", "-priority", "stiction_probability", "-yper_pct", "hammerstein_d", "health", "unit")
PLAIN = ("FIC101", "stiction", "reliable", "U1", "valve.stiction", "12.5", "2026-01-01T00:00:30Z", *COLUMNS)


@dataclass
class Asked:
    """One request as an ASGI server would hand it on."""

    method: str
    route: str
    path: bytes  # as it stands in the request line
    query: bytes = b""
    headers: list[tuple[bytes, bytes]] = field(default_factory=list)
    body: bytes = b""


class Requests:
    """An endless row of requests to one plant."""

    def __init__(self, schema: dict[str, Any], keys: dict[str, str], tags: tuple[str, ...], seed: int) -> None:
        self._random = random.Random(seed)
        self._schema = schema
        self._keys = keys
        self._tags = tags
        self._exports = list(seeds().items())
        self.session: tuple[str, str] | None = None  # cookie, token of its forms
        self._routes = [(method, path, self._operation(method, path)) for method, path in ROUTES]
        self._dear = [route for route in self._routes if route[1].startswith("/v1/")]

    def _operation(self, method: str, path: str) -> dict[str, Any]:
        return self._schema["paths"].get(path.replace(":path", ""), {}).get(method.lower(), {})

    def next(self) -> Asked:
        pick = self._random
        method, route, operation = pick.choice(self._dear if pick.random() < 0.6 else self._routes)
        asked = Asked(method, route, self._path(route), self._query(operation))
        if pick.random() < 0.03:
            asked.method = pick.choice(hostile.METHODS)
        elif method == "GET" and pick.random() < 0.05:
            asked.method = "HEAD"
        self._give_body(asked, operation)
        self._give_headers(asked)
        return asked

    # Where

    def _path(self, route: str) -> bytes:
        parts = []
        for part in route.split("/"):
            name = part.strip("{}").removesuffix(":path") if part.startswith("{") else None
            parts.append(part if name is None else self._path_value(name))
        path = "/".join(parts)
        return (path + self._word() if self._random.random() < 0.01 else path).encode("utf-8", "replace")

    def _path_value(self, name: str) -> str:
        if self._random.random() < 0.25:
            word = self._word()
            return quote(word.encode("utf-8", "replace"), safe="/%") if self._random.random() < 0.7 else word
        if name == "tag":
            return quote(self._random.choice(self._tags), safe="")
        return "loopaudit.css" if name == "path" else str(self._random.choice((1, 1, 1, 2, 3, 50)))

    def _query(self, operation: dict[str, Any]) -> bytes:
        declared = [each for each in operation.get("parameters", ()) if each["in"] == "query"]
        pairs = [(each["name"], self._query_value(each["schema"])) for each in declared if self._random.random() < 0.3]
        if not operation and self._random.random() < 0.5:
            pairs = [(self._random.choice(PAGES_QUERY), self._text()) for _ in range(self._random.randrange(4))]
        if self._random.random() < 0.05:
            pairs.append((self._text(), self._text()))
        if self._random.random() < 0.02:
            return self._word().encode("utf-8", "replace")[:3000]
        return urlencode(pairs, errors="replace").encode()

    def _query_value(self, schema: dict[str, Any]) -> str:
        if self._random.random() < 0.4:
            return self._text()
        value = self._valid(schema)
        return str(value[0] if isinstance(value, list) and value else value)

    # What

    def _give_body(self, asked: Asked, operation: dict[str, Any]) -> None:
        pick = self._random
        if asked.method in ("GET", "HEAD") and pick.random() > 0.02:
            return
        if asked.route.endswith("/uploads"):
            kind, asked.body = self._upload()
        elif operation.get("requestBody"):
            content = operation["requestBody"]["content"]
            kind = next(iter(content))
            asked.body = self._json(content[kind].get("schema", {}))
        else:
            kind, asked.body = self._form()
        if pick.random() < 0.1:
            asked.body = pick.choice(hostile.BODIES)
        if pick.random() < 0.05:
            kind = pick.choice(hostile.KINDS)
        asked.headers.append((b"content-type", kind.encode("latin-1", "replace")))
        if pick.random() < 0.5:
            asked.headers.append((b"content-length", str(len(asked.body)).encode()))

    def _json(self, schema: dict[str, Any]) -> bytes:
        value = self._valid(schema)
        if self._random.random() < 0.5 and isinstance(value, dict):
            name = self._random.choice([*value, self._text()])
            value[name] = self._random.choice((self._text(), self._random.choice(hostile.VALUES)))
        body = json.dumps(value, ensure_ascii=self._random.random() < 0.9).encode("utf-8", "surrogatepass")
        if self._random.random() < 0.05:
            body = body.replace(b"1", self._random.choice(hostile.RAW_NUMBERS), 1)
        return self._spoilt(body) if self._random.random() < 0.05 else body

    def _valid(self, schema: dict[str, Any], depth: int = 0) -> Any:
        """A value as the schema wants it."""
        pick = self._random
        if "$ref" in schema:
            schema = self._schema["components"]["schemas"][schema["$ref"].rsplit("/", 1)[1]]
        if "enum" in schema or "const" in schema:
            return pick.choice(schema.get("enum", [schema.get("const")]))
        if "anyOf" in schema:
            return self._valid(pick.choice(schema["anyOf"]), depth + 1)
        made: dict[str, Callable[[], Any]] = {
            "integer": lambda: pick.randint(schema.get("minimum", -5), min(schema.get("maximum", 100), 200)),
            "number": lambda: self._number(schema),
            "boolean": lambda: pick.random() < 0.5,
            "null": lambda: None,
            "array": lambda: [self._valid(schema.get("items", {}), depth + 1) for _ in range(pick.randrange(4))],
            "object": lambda: self._object(schema, depth),
            "string": lambda: self._string(schema),
        }
        return made.get(schema.get("type", ""), lambda: pick.choice(hostile.VALUES))()

    def _number(self, schema: dict[str, Any]) -> float:
        low = schema.get("minimum", schema.get("exclusiveMinimum", -1000))
        return self._random.choice((low, self._random.uniform(low, min(schema.get("maximum", low + 1000), 1e6)), 1.5))

    def _object(self, schema: dict[str, Any], depth: int) -> dict[str, Any]:
        if "properties" not in schema:
            model = {"gain": 0.5, "time_constants_s": [30.0], "dead_time_s": 4.0, "integrating": False}
            return {name: value for name, value in model.items() if self._random.random() < 0.9}
        share = 0.3 if depth else 0.5
        wanted = schema.get("required", ())
        return {
            name: self._valid(inner, depth + 1)
            for name, inner in schema["properties"].items()
            if name in wanted or self._random.random() < share
        }

    def _string(self, schema: dict[str, Any]) -> str:
        if schema.get("format") == "date-time":
            return f"2026-01-01T00:{self._random.randrange(60):02d}:00Z"
        return self._random.choice((*self._tags, *PLAIN))[: schema.get("maxLength", 10**6)]

    def _form(self) -> tuple[str, bytes]:
        names = self._random.sample(PAGES_FORM, self._random.randrange(1, 8))
        pairs = {name: self._text() for name in names}
        if self._random.random() < 0.5:
            pairs |= {"importance": self._random.choice(("1", "5", "1000", "nan", "-1"))}
        if self.session and self._random.random() < 0.9:
            pairs = {"csrf_token": self.session[1], **pairs}
        if self._random.random() < 0.8:
            return "application/x-www-form-urlencoded", urlencode(pairs, errors="replace").encode()
        return self._multipart([(name, None, text.encode("utf-8", "replace")) for name, text in pairs.items()])

    def _upload(self) -> tuple[str, bytes]:
        name, data = self._random.choice(self._exports)
        data = self._spoilt(data) if self._random.random() < 0.7 else data
        if self._random.random() < 0.5:
            return self._random.choice(("text/csv", "application/octet-stream", "application/gzip")), data
        mapping = self._random.choice(
            (b"tag,loop,signal\nFIC1.PV,X,PV\n", b'[{"tag":"a","loop":"b","signal":"OP","low":"x"}]', b"tag\n", b"[1]")
        )
        parts: list[tuple[str, str | None, bytes]] = [
            ("file", name if self._random.random() < 0.8 else self._text(), data)
        ]
        if self._random.random() < 0.5:
            file = "mapping.csv" if self._random.random() < 0.5 else None
            parts.append(("mapping", file, self._spoilt(mapping) if self._random.random() < 0.5 else mapping))
        if self.session and self._random.random() < 0.8:
            parts.insert(0, ("csrf_token", None, self.session[1].encode()))
        return self._multipart(parts)

    def _multipart(self, parts: list[tuple[str, str | None, bytes]]) -> tuple[str, bytes]:
        body = b""
        for name, file, data in parts:
            shown = "" if file is None else f'; filename="{file}"'
            head = f'--b0\r\nContent-Disposition: form-data; name="{name}"{shown}\r\n\r\n'
            body += head.encode("utf-8", "replace") + data + b"\r\n"
        body += b"--b0--\r\n"
        return "multipart/form-data; boundary=b0", self._spoilt(body) if self._random.random() < 0.15 else body

    def _spoilt(self, data: bytes) -> bytes:
        spoilt = bytearray(data[:4000])
        for _ in range(self._random.randrange(1, 6)):
            at = self._random.randrange(len(spoilt) + 1)
            word = self._word().encode("utf-8", "replace")[:200]
            kind = self._random.randrange(4)
            if kind == 0:
                del spoilt[at:]
            elif kind == 1:
                spoilt[at:at] = word
            elif kind == 2:
                spoilt[at : at + len(word)] = word
            else:
                spoilt[at : at + 1] = bytes([self._random.randrange(256)])
        return bytes(spoilt)

    # Who

    def _give_headers(self, asked: Asked) -> None:
        pick = self._random
        host = pick.choice(hostile.HOSTS) if pick.random() < 0.03 else "localhost"
        headers = [("host", host)]
        draw = pick.random()
        if draw < 0.6:
            headers.append(("authorization", f"Bearer {self._keys['admin']}"))
        elif draw < 0.75:
            headers.append(("x-api-key", self._keys[pick.choice(list(self._keys))]))
        elif draw < 0.95 and self.session:
            headers.append(("cookie", f"loopaudit_session={self.session[0]}"))
            if asked.method not in ("GET", "HEAD") and pick.random() < 0.5:
                headers.append(("x-csrf-token", self.session[1]))
        if pick.random() < 0.25:
            headers += [pick.choice(hostile.HEADERS) for _ in range(pick.randrange(1, 3))]
        asked.headers += [
            (
                name.encode(),
                value.encode("utf-8", "replace") if ord(max(value, default=" ")) > 255 else value.encode("latin-1"),
            )
            for name, value in headers
        ]

    def _text(self) -> str:
        return self._random.choice((*self._tags, *PLAIN)) if self._random.random() < 0.4 else self._word()

    def _word(self) -> str:
        return self._random.choice(hostile.WORDS)
