"""Structured logs on stderr: one event a line, with the ids of request, run and loop, and nothing secret in it."""

import logging
import re
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import structlog

from app.settings import Settings

HIDDEN = "***"
KEY = re.compile(r"la_(read|upload|audit|admin)_([a-z2-7]{4,10})_[0-9A-Za-z]{8,}")
SECRETS = (
    (KEY, rf"la_\1_\2_{HIDDEN}"),  # of a key the role and the id may be told
    # the password in an address
    (re.compile(r"(\b[a-z][a-z0-9+.-]{0,40}://[^\s:/@'\"]*):([^\s@/'\"]+)@"), rf"\1:{HIDDEN}@"),
    (re.compile(r"(?i)\b(bearer|basic)\s+[A-Za-z0-9._~+/=-]{6,}"), rf"\1 {HIDDEN}"),
    (re.compile(r"(?i)\b(password|passwd|secret|csrf_token|loopaudit_session|x-api-key)(['\"]?\s*[=:]\s*['\"]?)[^\s'\",;&]{3,}"),
     rf"\1\2{HIDDEN}"),
)  # fmt: skip
SECRET_NAME = re.compile(r"(?i)(password|passwd|secret|csrf_token|loopaudit_session|x-api-key)$")
"""Whatever has such a name is one."""
QUIET = (
    "sqlalchemy",
    "celery",
    "kombu",
    "alembic",
    "asyncio",
    "numba",
    "httpx",
    "httpcore",
    "multipart",
    "python_multipart",
)


def configure(settings: Settings, least: str = "") -> None:
    """For this process; what libraries log by themselves takes the same way. `least`: the level, in place of that of
    the settings."""
    as_json = is_json(settings)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter(as_json))
    if as_json:  # also what Python would write there itself, in many lines
        logging.captureWarnings(True)
        sys.excepthook, threading.excepthook, sys.unraisablehook = _fault, _fault_of_thread, _fault_nobody_sees
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(least or settings.log_level.upper())
    for name in QUIET:
        logging.getLogger(name).setLevel("WARNING")
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access"):
        logging.getLogger(name).handlers.clear()
        logging.getLogger(name).propagate = True
    logging.getLogger("uvicorn").setLevel("WARNING")


def is_json(settings: Settings) -> bool:
    return settings.log_format == "json" or (settings.log_format == "auto" and not sys.stderr.isatty())


def in_json(text: str, level: str = "info", **told: object) -> str:
    """What a process says beside its log, as a line of the log."""
    number = logging.getLevelNamesMapping()[level.upper()]
    record = logging.getLogger("loopaudit").makeRecord("loopaudit", number, "", 0, text, (), None, extra=dict(told))
    return formatter(as_json=True).format(record)


def _fault(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """In place of a traceback of many lines."""
    logging.getLogger("loopaudit").critical("fault", exc_info=(kind, error, trace))


def _fault_of_thread(told: threading.ExceptHookArgs) -> None:
    if told.exc_value is not None and told.exc_type is not SystemExit:
        _fault(told.exc_type, told.exc_value, told.exc_traceback)


def _fault_nobody_sees(told: "sys.UnraisableHookArgs") -> None:
    """Of what is cleared away: there is nobody whom it could be raised to."""
    if told.exc_value is not None:
        _fault(told.exc_type, told.exc_value, told.exc_traceback)


def formatter(as_json: bool) -> logging.Formatter:
    """Of lines without secrets."""
    if not as_json:
        return Redacting(_rendering(plain_text()))
    as_object = structlog.processors.JSONRenderer(ensure_ascii=False)
    return _rendering(structlog.processors.format_exc_info, _without_secrets, as_object)


def _rendering(*steps: Any) -> logging.Formatter:
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[
            structlog.contextvars.merge_contextvars,
            structlog.stdlib.add_logger_name,
            structlog.stdlib.add_log_level,
            structlog.stdlib.ExtraAdder(),
            structlog.processors.TimeStamper(fmt="iso", utc=True),
        ],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *steps],
    )


def plain_text() -> structlog.dev.ConsoleRenderer:
    """Without colours, which could part a secret, and with tracebacks that show no values of variables."""
    return structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback)


def _without_secrets(_: object, __: str, event: structlog.typing.EventDict) -> dict[str, Any]:
    """Before it is JSON: there a quote is two characters, of which a secret must not take one along."""
    return {name: _hidden(value, name) for name, value in event.items()}


def _hidden(value: Any, name: str = "") -> Any:
    if value is None or isinstance(value, bool):
        return value
    if SECRET_NAME.search(name):
        return HIDDEN
    if isinstance(value, int | float):
        return value
    if isinstance(value, Mapping):
        return {redacted(str(key)): _hidden(of_key, str(key)) for key, of_key in value.items()}
    if isinstance(value, list | tuple):
        return [_hidden(one) for one in value]
    return redacted(value if isinstance(value, str) else repr(value))


class Redacting(logging.Formatter):
    """Hides secrets in the finished line, wherever they came from: a message, a value, an exception."""

    def __init__(self, inner: logging.Formatter) -> None:
        super().__init__()
        self._inner = inner

    def format(self, record: logging.LogRecord) -> str:
        return redacted(self._inner.format(record))


def redacted(text: str) -> str:
    for pattern, instead in SECRETS:
        text = pattern.sub(instead, text)
    return text


def without_keys(text: str) -> str:
    """What somebody sent, to be told or kept: an address may hold a key, where it was typed by mistake."""
    return KEY.sub(rf"la_\1_\2_{HIDDEN}", text)


@contextmanager
def about(**ids: object) -> Iterator[None]:
    """What is logged inside carries these ids: `about(run="7", loop="FIC101")`."""
    with structlog.contextvars.bound_contextvars(**{name: value for name, value in ids.items() if value is not None}):
        yield
