"""Which file an address of SQLite means."""

from pathlib import Path
from urllib.parse import unquote, urlsplit


def file_of(name: str | None) -> Path:
    """name: what the address has for the data base, a path or a URI (`file:/data/plant.db`)."""
    told = name or ""
    return Path(unquote(urlsplit(told).path) if told.startswith("file:") else told)
