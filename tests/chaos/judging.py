"""What must hold after all faults, asked of the database and the files themselves and of nobody's counters."""

import hashlib
from bisect import bisect_right
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import psycopg

from tests.chaos.client import Promise
from tests.chaos.faults import Scene
from tests.chaos.spoiled_worker import HANG, KILL, MEMORY, SLOW
from tests.chaos.watch import Injected

LEAST_DONE = 0.97
TAKEN_ALONG = 0.001
"""Share of healthy loops that may lose their worker three times, because faults hit it that often by chance."""
EXPECTED_CODES = {KILL: "worker_lost", HANG: "worker_lost", SLOW: "time_limit", MEMORY: "memory"}


@dataclass
class Judgement:
    """Each wrong thing with the moment that it is attributed to; None where there is none."""

    asserted: int = 0
    verdicts: int = 0
    uploads: int = 0
    samples: int = 0
    runs: int = 0
    lost: list[tuple[str, float | None]] = field(default_factory=list)
    duplicated: list[tuple[str, float | None]] = field(default_factory=list)
    unfinished: list[tuple[str, float | None]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    failures: Counter[str] = field(default_factory=Counter)


def judge(scene: Scene) -> Judgement:
    found = Judgement()
    with scene.installation.connect() as connection:
        _judge_uploads(connection, scene, found)
        _judge_samples(connection, scene, found)
        _judge_runs(connection, scene, found)
        _judge_bad_loops(connection, scene, found)
    return found


def _judge_uploads(connection: psycopg.Connection, scene: Scene, found: Judgement) -> None:
    """Every acknowledged upload: its row, its bytes on disk, read to the end."""
    rows = {row[0]: row[1:] for row in connection.execute("SELECT id, fingerprint, size_bytes, state FROM uploads")}
    folder = scene.installation.data_dir / "uploads"
    found.uploads = len(scene.client.promises)
    for promise in scene.client.promises:
        export, row = promise.export, rows.get(promise.upload_id)
        if row is None or row[0] != export.fingerprint or row[1] != len(export.content):
            found.lost.append((f"upload {promise.upload_id}: its row says {row}", promise.at))
        elif _fingerprint(folder / export.fingerprint) != export.fingerprint:
            found.lost.append((f"upload {promise.upload_id}: its bytes are not there", promise.at))
        elif row[2] != "done":
            found.unfinished.append((f"upload {promise.upload_id} is {row[2]}", promise.at))
    by_content = Counter(promise.export.fingerprint for promise in _distinct(scene.client.promises))
    found.duplicated += [(f"upload {key[:8]} has {n} rows", None) for key, n in by_content.items() if n > 1]


def _distinct(promises: list[Promise]) -> list[Promise]:
    return list({promise.upload_id: promise for promise in promises}.values())


def _fingerprint(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def _judge_samples(connection: psycopg.Connection, scene: Scene, found: Judgement) -> None:
    """Of each loop as many samples as were promised to be kept: none lost, none twice."""
    expected: dict[str, dict[str, int]] = defaultdict(dict)
    for promise in scene.client.promises:
        for tag in promise.export.loops:
            expected[tag][promise.export.name] = promise.export.rows
    query = "SELECT l.tag, sum(s.samples)::int FROM series s JOIN loops l ON l.id = s.loop_id GROUP BY l.tag"
    stored = dict(connection.execute(query).fetchall())
    found.samples = sum(stored.values())
    for tag, exports in expected.items():
        wanted, there = sum(exports.values()), stored.get(tag, 0)
        if there < wanted:
            found.lost.append((f"{tag}: {wanted - there} of {wanted} samples", None))
        elif there > wanted:
            found.duplicated.append((f"{tag}: {there - wanted} samples more than {wanted}", None))


def _judge_runs(connection: psycopg.Connection, scene: Scene, found: Judgement) -> None:
    """Every run ended; every loop that was asked for with exactly one verdict or exactly one stated failure."""
    at = scene.client.runs
    loops_of = dict(connection.execute("SELECT audit_id, count(*) FROM audit_items GROUP BY audit_id").fetchall())
    for run, asked in scene.client.asked.items():
        if loops_of.get(run, 0) != asked:
            found.lost.append((f"run {run} has {loops_of.get(run, 0)} loops of {asked} that were asked for", at[run]))
    for number, state in connection.execute("SELECT id, state FROM audits ORDER BY id"):
        found.runs += 1
        if state not in ("done", "partial"):
            found.unfinished.append((f"run {number} is {state}", at.get(number)))
    lost_runs = set(at) - {row[0] for row in connection.execute("SELECT id FROM audits")}
    found.lost += [(f"run {number} was acknowledged and is not there", at[number]) for number in lost_runs]
    query = """
        SELECT i.audit_id, i.loop_id, i.state, i.code, count(v.loop_id)
        FROM audit_items i LEFT JOIN verdicts v ON v.audit_id = i.audit_id AND v.loop_id = i.loop_id
        GROUP BY i.audit_id, i.loop_id, i.state, i.code"""
    for run, loop, state, code, verdicts in connection.execute(query):
        found.asserted += 1
        found.verdicts += verdicts
        what, when = f"loop {loop} of run {run} is {state} with {verdicts} verdicts", at.get(run)
        if state in ("open", "claimed"):
            found.unfinished.append((what, when))
        elif verdicts + (state == "failed") == 0 or (state == "failed" and not code):
            found.lost.append((what, when))
        elif verdicts + (state == "failed") > 1:
            found.duplicated.append((what, when))
        if state == "failed":
            found.failures[code] += 1
    strays = """SELECT count(*) FROM verdicts v WHERE NOT EXISTS
        (SELECT 1 FROM audit_items i WHERE i.audit_id = v.audit_id AND i.loop_id = v.loop_id AND i.state = 'done')"""
    (stray,) = connection.execute(strays).fetchone() or (0,)
    found.duplicated += [(f"{stray} verdicts of loops that are not done", None)] * bool(stray)


def _judge_bad_loops(connection: psycopg.Connection, scene: Scene, found: Judgement) -> None:
    """A bad loop is set aside with its code, and takes no healthy loop of its run with it by more than chance."""
    query = """SELECT l.tag, i.state, i.code FROM audit_items i JOIN loops l ON l.id = i.loop_id
        WHERE i.audit_id = %s AND l.tag = %s"""
    for run, tag in scene.bad_runs:
        row = connection.execute(query, (run, tag)).fetchone()
        # A worker that is lost by another fault meanwhile counts against the loop too.
        codes = {EXPECTED_CODES[tag], "worker_lost"}
        if row is None or row[1] != "failed" or row[2] not in codes:
            found.wrong.append(f"run {run}: {tag} should be failed with {EXPECTED_CODES[tag]}, is {row}")
    healthy = """SELECT count(*) FROM audit_items i JOIN loops l ON l.id = i.loop_id
        WHERE i.code = 'worker_lost' AND NOT l.tag = ANY(%s)"""
    (taken,) = connection.execute(healthy, (list(EXPECTED_CODES),)).fetchone() or (0,)
    if taken > TAKEN_ALONG * found.asserted:
        found.wrong.append(f"{taken} healthy loops of {found.asserted} lost their workers until they were given up")


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    fault: str
    times: int
    lost: int
    duplicated: int
    unfinished: int
    median_s: float
    longest_s: float
    open: int


def table(scene: Scene, found: Judgement) -> list[Row]:
    """Each wrong thing stands with the fault that came last before it; what has no moment, with the last of all."""
    injected = [fault for fault in scene.watch.faults if fault.skipped is None]
    moments = [fault.at for fault in injected]

    def blamed(wrong: list[tuple[str, float | None]]) -> Counter[str]:
        at = [len(injected) if when is None else bisect_right(moments, when) for _, when in wrong]
        return Counter(injected[max(index, 1) - 1].kind for index in at if injected)

    lost, duplicated, unfinished = blamed(found.lost), blamed(found.duplicated), blamed(found.unfinished)
    rows = []
    for kind in sorted({fault.kind for fault in injected}):
        mine = [fault for fault in injected if fault.kind == kind]
        took = [fault.recovered_s for fault in mine if fault.recovered_s is not None]
        middle, longest = (median(took), max(took)) if took else (float("nan"), float("nan"))
        counts = (lost[kind], duplicated[kind], unfinished[kind])
        rows.append(Row(kind, len(mine), *counts, middle, longest, len(mine) - len(took)))
    return rows


def undone(faults: list[Injected]) -> list[str]:
    """Whether faults were skipped that this machine could do: a run with few faults shows little."""
    possible = [fault for fault in faults if not fault.left_out]
    done = [fault for fault in possible if fault.skipped is None]
    if len(done) < LEAST_DONE * len(possible):
        return [f"{len(done)} of {len(possible)} faults were done"]
    return []


def complaints(rows: list[Row], found: Judgement, least_audits: int, longest_s: float) -> list[str]:
    """Why the run is not passed; empty where it is."""
    wrong = [text for text, _ in (*found.lost, *found.duplicated, *found.unfinished)] + found.wrong
    wrong += [f"{row.fault}: {row.longest_s:.0f} s to recover" for row in rows if row.longest_s > longest_s]
    wrong += [f"{row.fault}: {row.open} times not recovered at all" for row in rows if row.open]
    if found.asserted < least_audits:
        wrong.append(f"{found.asserted} loop audits asserted, {least_audits} wanted")
    return wrong
