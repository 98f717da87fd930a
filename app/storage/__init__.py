"""Rows <-> engine types. `Database` opens the data base; each other module keeps one kind of row."""

from app.storage.database import Database

__all__ = ["Database"]
