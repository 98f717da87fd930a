"""An export of two loops, and files of one tag, sent and read, for the tests of uploads."""

import gzip
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np
from sqlalchemy import update

from app.services.backend import Backend
from app.services.intake import reading, uploads
from app.services.intake.uploads import ReadingOptions
from app.services.outward import UploadOut
from app.storage.tables import uploads as uploads_table

WIDE = "time,FIC1.PV,FIC1.OP,FIC1.SP,LIC2.PV,LIC2.OP\n"


def export(rows: int = 200, start: int = 1_750_000_000, spoiled: bool = False) -> bytes:
    lines = [WIDE]
    for i in range(rows):
        lines.append(f"{start + i},{50 + np.sin(i / 9):.3f},{40 + np.cos(i / 9):.3f},50,{i % 7},{i % 5}\n")
    if spoiled:
        lines[5] = f"{start + 4},Bad Input,40,50,1,1\n"
    return "".join(lines).encode()


def of_one_tag(values: Sequence[str], shift_s: int = 0) -> bytes:
    """A file without a row of names, a value a minute: its tag is its name."""
    start = datetime(2026, 3, 1, tzinfo=UTC) + timedelta(seconds=shift_s)
    return "".join(f"{start + timedelta(minutes=i):%Y-%m-%d %H:%M:%S},{v}\n" for i, v in enumerate(values)).encode()


def packed(data: bytes, at_s: int = 1) -> bytes:
    """gzip stamps the time, so that whoever packs once more sends other bytes."""
    return gzip.compress(data, mtime=at_s)


def send(backend: Backend, data: bytes, name: str = "night.csv", options: ReadingOptions | None = None) -> UploadOut:
    with uploads.receive(backend, filename=name, reading=options) as receiving:
        for start in range(0, len(data), 1000):
            receiving.write(data[start : start + 1000])
        return receiving.commit().upload


def read(backend: Backend, upload: UploadOut, owner: str = "w") -> UploadOut:
    reading.read_upload(backend, int(upload.id), owner)
    return uploads.get_upload(backend, upload.id)


def expire(backend: Backend, upload: UploadOut, **values: object) -> None:
    with backend.database.write() as connection:
        connection.execute(update(uploads_table).where(uploads_table.c.id == int(upload.id)).values(**values))
