"""Stretches of an upload that cannot be read are found and dropped, however many it has."""

import numpy as np
import pytest
from sqlalchemy import select, update

from app.storage import Database, loops, lost, series
from app.storage.samples import Samples
from app.storage.series import Stretch
from app.storage.tables import series as table
from tests.storage.stored import upload


def test_all_are_looked_at_a_few_at_a_time(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lost, "STRETCHES_AT_ONCE", 2)
    with database.write() as connection:
        sent = upload(connection)
        ids = loops.ensure(connection, [f"FIC{number}" for number in range(7)])
        for loop_id in ids.values():
            samples = Samples(np.arange(3, dtype=np.int64) * 10**9, {"pv": np.arange(3.0)})
            series.add(connection, [Stretch(loop_id, samples)], None)
        stretches = list(connection.scalars(select(table.c.id).order_by(table.c.id)))
        connection.execute(update(table).values(upload_id=sent))
        damaged = stretches[:1] + stretches[3:]
        connection.execute(update(table).where(table.c.id.in_(damaged)).values(packed=b"gone"))
        assert lost.damaged_of(connection, sent) == damaged
        lost.drop_stretches(connection, damaged)
        assert list(connection.scalars(select(table.c.id).order_by(table.c.id))) == stretches[1:3]
        assert lost.damaged_of(connection, sent) == []
