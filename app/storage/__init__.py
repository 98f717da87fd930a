"""Rows <-> engine types. `Database` opens the database; each other module keeps one kind of row."""

from app.storage.database import Database

__all__ = ["Database"]
