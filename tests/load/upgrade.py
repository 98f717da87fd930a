"""How long an upgrade takes that unpacks every stored stretch: `python tests/load/upgrade.py URL`, of no tables yet.

Fills tables of version 0009 with days of one loop, brings them to 0010, and says the time for a million of them.
"""

import argparse
import time

import numpy as np
from sqlalchemy import MetaData, Table, insert, text

from app.storage import Database, schema
from app.storage.samples import Samples, pack

DIFFERENT = 20
DAY_S = 86_400
SECOND = 1_000_000_000


def day(number: int, samples: int) -> bytes:
    rng = np.random.default_rng(number)
    op = np.round(40 + np.cumsum(rng.normal(0, 0.05, samples)), 2)
    pv = np.round(50 + np.cumsum(rng.normal(0, 0.05, samples)), 2)
    time_ns = np.linspace(0, DAY_S, samples, endpoint=False).astype(np.int64) * SECOND
    return pack(Samples(time_ns, {"pv": pv, "op": op, "sp": np.full(samples, 50.0), "automatic": np.ones(samples)}))


def fill(database: Database, stretches: int, samples: int) -> None:
    days = [day(number, samples) for number in range(DIFFERENT)]
    with database.write() as connection:
        series = Table("series", MetaData(), autoload_with=connection)
        at = {"moment": "2026-01-01 00:00:00+00:00"}
        connection.execute(text("INSERT INTO loops (id, tag, created_at) VALUES (1, 'FIC1', :moment)"), at)
        for number in range(stretches):
            span = {"start_ns": number * DAY_S * SECOND, "end_ns": (number + 1) * DAY_S * SECOND - SECOND}
            row = {"loop_id": 1, "samples": samples, "fingerprint": str(number), "packed": days[number % DIFFERENT]}
            connection.execute(insert(series), row | span)


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("url")
    asked.add_argument("--stretches", type=int, default=4000)
    asked.add_argument("--samples", type=int, default=8640)
    wanted = asked.parse_args()
    database = Database(wanted.url)
    schema.migrate(database, "0009")
    fill(database, wanted.stretches, wanted.samples)
    started, worked = time.perf_counter(), time.process_time()
    schema.migrate(database, "0010")
    took_s, worked_s = time.perf_counter() - started, time.process_time() - worked
    minutes = 1e6 / wanted.stretches / 60
    print(f"{wanted.stretches} stretches of {wanted.samples} samples: {took_s:.1f} s, {worked_s:.1f} s of processor")
    print(f"a million: {took_s * minutes:.0f} min, {worked_s * minutes:.0f} min of processor")
