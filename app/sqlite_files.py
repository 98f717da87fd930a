"""Which file an address of SQLite means."""

from pathlib import Path
from urllib.parse import unquote, urlsplit

from sqlalchemy.engine import URL
from sqlalchemy.util import asbool


def file_of(url: URL) -> Path:
    """Of a path, or of a URI (`sqlite:///file:/data/plant.db?uri=true`)."""
    name = url.database or ""
    return Path(unquote(urlsplit(name).path) if _is_uri(url) else name)


def asks_for_no_writes(url: URL) -> bool:
    """Whether a URI says so; of another address the driver heeds neither word."""
    return _is_uri(url) and (url.query.get("mode") == "ro" or asbool(url.query.get("immutable", False)))


def _is_uri(url: URL) -> bool:
    """Both are needed: else the name is that of a file, `file:` and all."""
    return (url.database or "").startswith("file:") and asbool(url.query.get("uri", False))
