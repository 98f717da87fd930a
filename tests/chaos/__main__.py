"""Runs the service under faults and judges what is left of its promises: `make chaos`, `make chaos SEED=7`.

Starts an installation of its own, breaks something every 5 to 20 s after a schedule that the seed determines, while
clients send exports and start audits; then lets it come to rest and asks the database and the files.
"""

import argparse
import contextlib
import os
import random
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import psycopg

from app.settings import Settings
from tests.chaos import spoiled_worker
from tests.chaos.client import Client, Plant, bad_loops
from tests.chaos.faults import BY_NAME, FAULTS, Fault, Planned, Scene, inject, log_line, schedule, tell
from tests.chaos.installation import Installation, MissingError, installed, until
from tests.chaos.judging import Judgement, Row, complaints, judge, table, undone
from tests.chaos.page import page_table, refresh
from tests.chaos.watch import Watch

REST_S = 420.0
START_S = 900.0
# What differs from the defaults: a hanging loop holds up its worker for 10 s instead of 40 s, and on a machine that is
# shared with others the workers get their share of it.
SETTINGS = {"LOOPAUDIT_LOOP_LIMIT_S": "5", "LOOPAUDIT_WORKER_NICE": "0", "LOOPAUDIT_LOG_FORMAT": "json"}
QUICK = {"LOOPAUDIT_LOOP_LIMIT_S": "2", "LOOPAUDIT_LEASE_S": "5", "LOOPAUDIT_SWEEP_S": "1", "LOOPAUDIT_STALLED_S": "2"}
# The cut in `make test` judges what is lost, not the speed of the machine that runs all tests at once.
SHORT_KINDS = (
    "kill -9 a worker whole",
    "kill -9 the API, unsynced writes lost",
    "kill -9 Redis, its memory lost",
    "PostgreSQL stopped at once",
    "kill -9 a worker's child",
)


@dataclass(frozen=True)
class Extent:
    """How much of it: faults, loops, audits to assert."""

    faults: int
    kinds: list[Fault]
    loops: int
    first_rows: int
    audits: int
    uploads_every_s: float
    settings: dict[str, str]
    pace: float = 1.0
    longest_s: float = 60.0


def extent(options: argparse.Namespace) -> Extent:
    if options.short:
        kinds = [BY_NAME[name] for name in SHORT_KINDS]
        return Extent(len(kinds), kinds, 60, 200, 60, 0.5, {**SETTINGS, **QUICK}, pace=0.4, longest_s=300.0)
    kinds = [BY_NAME[name] for name in options.only] if options.only else list(FAULTS)
    return Extent(options.faults, kinds, options.loops, 300, options.audits, 2.0, SETTINGS)


def far_night() -> dict[str, str]:
    """The nightly run would audit the bad loops too, again and again as the clock jumps over its hour."""
    return {"LOOPAUDIT_NIGHTLY_AT": time.strftime("%H:00", time.gmtime(time.time() + 12 * 3600))}


def fill(installation: Installation, client: Client) -> None:
    tell("the first exports of all loops")
    client.fill()
    with client.http() as http:
        client.send_until_taken(http, bad_loops(tuple(spoiled_worker.POISONS)))
    until(lambda: _unread(installation) == 0, START_S, "the first exports were not read\n" + installation.logs())


def _unread(installation: Installation) -> int:
    with installation.connect() as connection:
        row = connection.execute("SELECT count(*) FROM uploads WHERE state <> 'done'").fetchone()
    return row[0] if row else 0


def disturb(scene: Scene, planned: list[Planned]) -> None:
    """Each fault by a thread of its own: some take a while, and the next one does not wait."""
    started = time.monotonic()
    with ThreadPoolExecutor(max_workers=len(planned)) as threads:
        for one in planned:
            time.sleep(max(0.0, started + one.at_s - time.monotonic()))
            threads.submit(lambda one=one: tell(log_line(inject(scene, one), started)))


def come_to_rest(scene: Scene) -> None:
    """No fault any more, nothing new asked for: whatever was promised must come by itself."""
    tell("no more faults; waiting for what was promised")
    scene.client.enough.set()
    scene.finish()
    scene.client.end()
    scene.client.send_the_rest()
    deadline = time.monotonic() + REST_S
    while time.monotonic() < deadline:
        with contextlib.suppress(psycopg.OperationalError):  # it comes again by itself
            if not _left(scene.installation):
                scene.watch.idle.set()
                if not scene.watch.open:
                    return
        time.sleep(0.5)


def _left(installation: Installation) -> int:
    query = """SELECT (SELECT count(*) FROM uploads WHERE state IN ('received', 'reading'))
        + (SELECT count(*) FROM audits WHERE state IN ('planned', 'running'))"""
    with installation.connect() as connection:
        row = connection.execute(query).fetchone()
    return row[0] if row else 0


def run(options: argparse.Namespace) -> int:
    wanted = extent(options)
    planned = schedule(options.seed, wanted.faults, wanted.kinds, wanted.pace)
    plant = Plant(wanted.loops, wanted.first_rows, 30, 20)
    began = time.monotonic()
    with installed(options.port, {**wanted.settings, **far_night()}, options.logs, share=options.share) as installation:
        tell(f"seed {options.seed}: {len(planned)} faults in {planned[-1].at_s / 60:.1f} min")
        until(installation.ready, START_S, "not ready\n" + installation.logs())
        client = Client(installation.url, plant)
        watch = Watch(installation, client)
        lease_s = Settings(
            **{key.removeprefix("LOOPAUDIT_").lower(): value for key, value in wanted.settings.items()}
        ).lease_s
        scene = Scene(installation, client, watch, random.Random(), lease_s)
        fill(installation, client)
        watch.begin()
        client.begin(wanted.uploads_every_s)
        disturbed = time.monotonic()
        disturb(scene, planned)
        come_to_rest(scene)
        took_s = time.monotonic() - disturbed
        watch.end()
        found = judge(scene)
        rows = table(scene, found)
        wrong = complaints(rows, found, wanted.audits, wanted.longest_s) + undone(watch.faults)
        report(scene, rows, found, wrong)
        tell(f"{took_s / 60:.1f} min under faults, {(time.monotonic() - began) / 60:.1f} min in all")
        if wrong:
            tell(installation.logs(1500))
    if options.page is not None:
        refresh(options.page, page_table(rows, found, options.seed, took_s))
    return 1 if wrong else 0


def report(scene: Scene, rows: list[Row], found: Judgement, wrong: list[str]) -> None:
    print(f"{'fault':45} times  lost  dupl.  unfin.  recover s (median, max)")
    for row in rows:
        print(
            f"{row.fault:45} {row.times:5d} {row.lost:5d} {row.duplicated:6d} {row.unfinished:7d}"
            f"  {row.median_s:8.1f} {row.longest_s:8.1f}"
        )
    print(
        f"{sum(row.times for row in rows)} faults of {len(rows)} kinds; {found.asserted} loop audits in "
        f"{found.runs} runs ({found.verdicts} verdicts, stated failures {dict(found.failures)}); {found.uploads} "
        f"acknowledged uploads, {found.samples} samples; {scene.installation.taken_back} unsynced files taken back"
    )
    print(f"answers: {dict(scene.client.answers)}")
    skipped = [f"{fault.kind}: {fault.skipped}" for fault in scene.watch.faults if fault.skipped]
    print(f"skipped: {skipped}\nended by themselves: {scene.installation.supervisor.surprises}")
    for text in wrong[:50]:
        print(f"WRONG: {text}")
    print("FAILED" if wrong else "passed: all zero")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos", description=__doc__)
    parser.add_argument("--seed", type=int, default=None, help="replays the schedule of faults of that seed")
    parser.add_argument("--faults", type=int, default=206)
    parser.add_argument("--loops", type=int, default=1000, help="loops of the plant")
    parser.add_argument("--audits", type=int, default=14_000, help="least loop audits to assert")
    parser.add_argument("--only", action="append", choices=list(BY_NAME), help="this kind of fault (may be repeated)")
    parser.add_argument("--short", action="store_true", help="a few kinds once each, on a small plant")
    parser.add_argument("--share", type=int, help="on a machine that others load: precedence from 1 to 20 (root only)")
    parser.add_argument("--port", type=int, default=None, help="first of three ports; any free ones otherwise")
    parser.add_argument("--logs", type=Path, default=None, help="folder that keeps the processes' logs")
    parser.add_argument("--page", type=Path, default=None, help="page whose table is written anew")
    options = parser.parse_args()
    if options.seed is None:
        options.seed = int.from_bytes(os.urandom(3), "big")
    return options


if __name__ == "__main__":
    try:
        sys.exit(run(arguments()))
    except MissingError as missing:
        tell(f"cannot be run here: {missing}")
        sys.exit(77)
