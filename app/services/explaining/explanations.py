"""Explanations: a loop's recording against a simulation, asked for here, worked out by a worker, read here."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection

from app.engine.long_records.stretches import LONG_SAMPLES
from app.engine.mismatch.compare.comparison import LEAST_SAMPLES
from app.errors import DataError, NotFoundError, RequestError
from app.nanoseconds import NS_PER_H
from app.services.auditing.recordings import recording_of
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.damage import damage_in_words
from app.services.explaining.line import LINE_FIELDS
from app.services.explaining.simulations import GivenSimulation, comparison_with, kept, kind_of
from app.services.loops import find
from app.services.moments import iso_utc, latest_ns, moment_of, ns_of
from app.services.results import Page
from app.services.telling.repair_sides import explained_before
from app.services.telling.wording import codes_in
from app.storage import explanations, notes, series, verdicts
from app.storage.documents import Document, pack_document, unpack_document
from app.storage.explanations import ExplanationRow
from app.storage.loops import LoopRow
from app.storage.samples import Samples

EARLIEST_NS = -(1 << 63)  # that a time of a sample can hold
LONGEST_WINDOW_H = 10 * 365 * 24
MOST_OPEN = 1000
"""Explanations that may wait when one more is asked for: each takes a worker for up to minutes."""
MOST_UNPACKED = 5_000_000
"""Samples of stretches that a window touches, at most: they are unpacked to find those inside."""


@dataclass(frozen=True)
class Wanted:
    """Which stretch of the recording: from `start` to `end`, or `window_h` hours up to `end`; nothing: what the
    newest verdict rests on, or else the newest, and of a long one, where no simulation is given, the part that an audit
    judges.
    """

    start: datetime | None = None
    end: datetime | None = None
    window_h: float | None = None
    simulation: GivenSimulation = field(default_factory=GivenSimulation)

    @property
    def states_a_window(self) -> bool:
        return any(bound is not None for bound in (self.start, self.end, self.window_h))


def ask(backend: Backend, tag: str, wanted: Wanted | None = None, asked_by: str | None = None) -> dict[str, Any]:
    """Asks for an explanation and wakes a worker. What can be known to be wrong with the request is told at once."""
    wanted = wanted or Wanted()
    loop = find(backend, tag)
    asked = _audited(backend, loop, wanted) or _window(backend, loop, wanted)
    window = asked.samples
    samples = newest_samples(window, backend.settings.explanation_samples)
    recording = recording_of(loop, samples)
    simulation = kept(wanted.simulation, samples, recording, backend.settings.time_zone)
    as_judged = simulation is None and not wanted.states_a_window and len(window) > LONG_SAMPLES
    explained = window if as_judged else samples
    comparison_with(loop, explained, simulation)
    values = {
        "loop_id": loop.id,
        "asked_by": asked_by,
        "window_start_ns": asked.first_ns if explained is window else int(explained.time_ns[0]),
        "window_end_ns": asked.last_ns,
        "as_judged": as_judged,
        "simulation_packed": None if simulation is None else pack_document(simulation),
    }
    with backend.database.write() as connection:
        if explanations.count_open(connection, MOST_OPEN) >= MOST_OPEN:
            raise RequestError("too_many_open", f"{MOST_OPEN} explanations and more wait for a worker; wait for these")
        explanation_id = explanations.ask(connection, values)
        # Read here: what fails once the question stands would be told as nothing changed, and it would be asked again.
        row = _existing(connection, loop, str(explanation_id))
    backend.queue.explain(1)
    return _told(row, tag, simulation, {})


def get_explanation(backend: Backend, tag: str, explanation_id: str) -> dict[str, Any]:
    """The request and, as far as it is known, the answer: the fields of `loopaudit explain --format json`, flat."""
    row = _row(backend, tag, explanation_id)
    with backend.database.read() as connection:
        packed = explanations.packed_answer(connection, row.id)
        given = explanations.packed_simulation(connection, row.id)
    simulation = None if given is None else unpack_document(given)
    return _told(row, tag, simulation, {} if packed is None else unpack_document(packed).told)


def list_explanations(backend: Backend, tag: str, limit: int = 100, cursor: str | None = None) -> Page[dict[str, Any]]:
    """A loop's explanations, the newest first, without their answers."""
    loop = find(backend, tag)
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        rows = explanations.page(connection, loop.id, limit + 1, before[0] if before else None)
    return page_of(rows, limit, lambda row: summary(row, tag), lambda row: (row.id,))


def newest(backend: Backend, tag: str) -> dict[str, Any] | None:
    """A loop's newest explanation as `get_explanation` tells it, and `remarks`: what to keep in mind beside it, in
    sentences; None where there is none.
    """
    loop = find(backend, tag)
    with backend.database.read() as connection:
        rows = explanations.page(connection, loop.id, 1)
    if not rows:
        return None
    return get_explanation(backend, tag, str(rows[0].id)) | {"remarks": _remarks(backend, loop, rows[0])}


def _remarks(backend: Backend, loop: LoopRow, row: ExplanationRow) -> list[str]:
    """What makes an explanation an old one, a repair or an audit of what was recorded later; and that nothing missing
    from a linear loop clears no valve.
    """
    with backend.database.read() as connection:
        repaired_at = notes.repairs_stated_last(connection, [loop.id]).get(loop.id)
        newest_verdict = verdicts.newest_said(connection, loop.id)
        heard = verdicts.fingerprint_before(connection, loop.id, row.asked_at)
    told = []
    if repaired_at is not None and explained_before(summary(row, loop.tag), iso_utc(repaired_at)):
        told.append(f"This is from before the repair of {backend.clock.told_at(repaired_at)}.")
    if newest_verdict is None:
        return told
    if newest_verdict.audited_at > row.asked_at and _of_other_samples(newest_verdict, row, heard):
        audit = backend.clock.told_at(newest_verdict.audited_at)
        told.append(f"It was asked for before the audit of {audit}, which may rest on newer samples.")
    if newest_verdict.verdict == "stiction" and row.verdict in ("consistent", "inconclusive"):
        told.append("The audit says that the valve sticks: that this comparison names nothing does not clear it.")
    return told


def _of_other_samples(newest: verdicts.NewestSaid, row: ExplanationRow, heard: str | None) -> bool:
    """Whether a verdict may rest on what the explanation did not know. heard: the fingerprint of what the loop's newest
    verdict rested on when it was asked for; None: there was none, and only how far the samples go can be compared.
    """
    if heard is not None:
        return heard != newest.input_fingerprint
    if row.as_judged or newest.input_end_ns is None or row.window_end_ns is None:
        return True
    return newest.input_end_ns > row.window_end_ns


def summary(row: ExplanationRow, tag: str) -> dict[str, Any]:
    return {
        "id": str(row.id),
        "loop": tag,
        "state": "open" if row.state == "claimed" else row.state,
        "asked_at": iso_utc(row.asked_at),
        "asked_by": row.asked_by,
        "ended_at": iso_utc(row.ended_at),
        "audit_id": None if row.audit_id is None else str(row.audit_id),
        "window_start": _iso(row.window_start_ns),
        "window_end": _iso(row.window_end_ns),
        "as_judged": row.as_judged,
        "verdict": row.verdict,
        "effect_codes": list(codes_in(row.effects)),
        "error_code": row.error_code,
        "error_text": row.error_text,
        "waits_for_room_since": iso_utc(row.waits_since) if row.state == "open" else None,
    }


def stored_answer(backend: Backend, tag: str, explanation_id: str) -> Document:
    """The answer with its traces. Raises NotFoundError("not_explained") while there is none."""
    row = _row(backend, tag, explanation_id)
    with backend.database.read() as connection:
        packed = explanations.packed_answer(connection, row.id) if row.state == "done" else None
    if packed is None:
        state = summary(row, tag)["state"]
        raise NotFoundError("not_explained", f"explanation {explanation_id!r} of {tag!r} has no answer: it is {state}")
    return unpack_document(packed)


def newest_samples(samples: Samples, most: int) -> Samples:
    return samples.part(slice(-most, None)) if len(samples) > most else samples


def _told(row: ExplanationRow, tag: str, simulation: Document | None, answer: Mapping[str, Any]) -> dict[str, Any]:
    return summary(row, tag) | {"simulation": kind_of(simulation)} | _line(answer)


def _line(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Every field of the contract, null while it is not known, and whatever else the answer has. Verdict and simulation
    are told with the request.
    """
    line = answer.get("line", {})
    first = {name: None for name in LINE_FIELDS if name not in ("verdict", "simulation")}
    return first | {"effects": [], "evidence": []} | dict(line)


@dataclass(frozen=True, eq=False)
class _Asked:
    """The samples that are asked for, one at least, and which of that time cannot be read."""

    samples: Samples
    damaged: tuple[tuple[int, int], ...]

    @property
    def first_ns(self) -> int:
        """With what is damaged before the samples: the worker, which reads them again, is to tell it too."""
        return min([int(self.samples.time_ns[0]), *(first for first, _ in self.damaged)])

    @property
    def last_ns(self) -> int:
        return max([int(self.samples.time_ns[-1]), *(last for _, last in self.damaged)])


def _audited(backend: Backend, loop: LoopRow, wanted: Wanted) -> _Asked | None:
    """What the loop's newest verdict rests on, where neither a window nor a simulation is stated; None without
    one, or where too few samples of it are left to be explained. A damaged stretch is left out, as by the worker.
    """
    if wanted.states_a_window or wanted.simulation.stated:
        return None
    with backend.database.read() as connection:
        made = verdicts.newest_said(connection, loop.id)
        if made is None or made.input_start_ns is None or made.input_end_ns is None:
            return None
        window_ns = (made.input_start_ns, made.input_end_ns)
        found = series.readable(connection, loop.id, *window_ns, backend.settings.hold_days)
    if found.samples is None or len(found.samples) < LEAST_SAMPLES:
        return None
    return _Asked(found.samples, found.damaged)


def _window(backend: Backend, loop: LoopRow, wanted: Wanted) -> _Asked:
    """The samples that are asked for. Raises where there are none, or more than are explained at a time."""
    if loop.newest_ns is None:
        raise DataError("no_samples", f"loop {loop.tag!r} has no samples")
    hold_days = backend.settings.hold_days
    with backend.database.read() as connection:
        newest_ns = series.newest_before(connection, loop.id, loop.newest_ns, latest_ns())
        start_ns, end_ns = _bounds(newest_ns, wanted, backend.settings.window_h)
        stored = series.count_between(connection, loop.id, start_ns, end_ns)
        if stored > MOST_UNPACKED:
            raise DataError("window_too_large", f"the window touches {stored:,} samples; take a shorter one")
        found = series.readable(connection, loop.id, start_ns, end_ns, hold_days)
    samples = found.samples
    if samples is None or not len(samples):
        if found.damaged:
            raise DataError("damaged_samples", damage_in_words(found.damaged, backend.clock))
        raise DataError("no_samples", f"loop {loop.tag!r} has no samples from {_iso(start_ns)} to {_iso(end_ns)}")
    most = backend.settings.explanation_samples
    if len(samples) > most and (wanted.start or wanted.window_h):
        raise DataError(
            "window_too_large",
            f"the window has {len(samples):,} samples, at most {most:,} are explained; take a shorter one",
        )
    return _Asked(samples, found.damaged)


def _bounds(newest_ns: int, wanted: Wanted, window_h: float) -> tuple[int, int]:
    if wanted.start is not None and wanted.window_h is not None:
        raise RequestError("bad_window", "a window has a start or a length, not both")
    end_ns = newest_ns if wanted.end is None else ns_of(wanted.end)
    hours = window_h if wanted.window_h is None else wanted.window_h
    if not 0.0 < hours <= LONGEST_WINDOW_H:
        raise RequestError("bad_window", f"a window may be up to {LONGEST_WINDOW_H} hours long, got {hours}")
    start_ns = max(int(end_ns - hours * NS_PER_H), EARLIEST_NS) if wanted.start is None else ns_of(wanted.start)
    if start_ns >= end_ns:
        raise RequestError("bad_window", f"the window must end after it starts, got {_iso(start_ns)} to {_iso(end_ns)}")
    return start_ns, end_ns


def _row(backend: Backend, tag: str, explanation_id: str) -> ExplanationRow:
    loop = find(backend, tag)
    with backend.database.read() as connection:
        return _existing(connection, loop, explanation_id)


def _existing(connection: Connection, loop: LoopRow, explanation_id: str) -> ExplanationRow:
    row = explanations.by_id(connection, loop.id, identifier(explanation_id))
    if row is None:
        raise NotFoundError("unknown_explanation", f"loop {loop.tag!r} has no explanation {explanation_id!r}")
    return row


def _iso(time_ns: int | None) -> str | None:
    return None if time_ns is None else iso_utc(moment_of(time_ns))


__all__ = ["Wanted", "ask", "get_explanation", "list_explanations", "newest", "stored_answer"]
