"""Rows that tests of the database put there, and read back."""

import numpy as np
from sqlalchemy import Connection, insert

from app.storage import Database, loops, series
from app.storage.samples import Samples
from app.storage.series import Place, Stretch
from app.storage.tables import uploads
from app.storage.types import now

SECOND = 1_000_000_000
START = 1_750_000_000


def ramp(first: int, last: int, offset: float = 0.0) -> Samples:
    seconds = np.arange(first, last, dtype=np.int64)
    return Samples((START + seconds) * SECOND, {"pv": seconds + offset, "op": seconds / 2})


def add(database: Database, tag: str, *stretches: Samples) -> series.Added:
    with database.write() as connection:
        loop_id = loops.ensure(connection, [tag])[tag]
        return series.add(connection, [Stretch(loop_id, stretch) for stretch in stretches], None)


def add_as(database: Database, tag: str, stretch: Samples, place: Place) -> int:
    """How many samples were new, or replaced others."""
    with database.write() as connection:
        return placed(connection, loops.ensure(connection, [tag])[tag], stretch, place)


def placed(connection: Connection, loop_id: int, stretch: Samples, place: Place) -> int:
    added = series.add(connection, [Stretch(loop_id, stretch)], None, place)
    return added.samples + added.replaced


def window(database: Database, tag: str, hours: float = 24.0, most: int = 10**6) -> Samples:
    with database.read() as connection:
        loop_id = loops.ids_of(connection, [tag])[tag]
        return series.windows(connection, [loop_id], hours, most)[loop_id]


def steps(name: str, *changes: tuple[int, float]) -> Samples:
    """A signal of its own that is stored when it changes: (second, value)."""
    seconds, values = zip(*changes, strict=True)
    return Samples((START + np.array(seconds, dtype=np.int64)) * SECOND, {name: np.array(values, dtype=float)})


def first(samples: Samples, name: str) -> float:
    return float(samples.signals[name][0])


def upload(connection: Connection, name: str = "a", **told: object) -> int:
    values = {"content_key": name, "fingerprint": name, "filename": name, "size_bytes": 1, "received_at": now()}
    return connection.execute(insert(uploads).values(values | told).returning(uploads.c.id)).scalar_one()
