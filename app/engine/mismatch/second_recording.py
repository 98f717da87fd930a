"""What a second recording, which no model was fitted to, says of an explanation."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from app.engine.evidence import Reason
from app.engine.mismatch.compare.comparison import Comparison, mended, record_of
from app.engine.mismatch.compare.patterns import find_patterns
from app.engine.mismatch.compare.preparing import OTHER_UNIT, Prepared, without_hidden
from app.engine.mismatch.compare.resting import Lacking, rest_along, rest_unknown
from app.engine.mismatch.compare.sampling import as_compared, taken_of
from app.engine.mismatch.compete.selection import Selection
from app.engine.mismatch.judge.result import Explanation
from app.engine.mismatch.judge.validation import lasting, validate
from app.engine.mismatch.loop.experiment import Experiment, span
from app.engine.recording import FloatArray
from app.errors import DataError


class SecondRecordingError(DataError):
    """The second recording cannot be used; nothing is wrong with the first."""


def mended_second(validation: Comparison) -> Comparison:
    """As `mended`; what it raises says that it is of the second recording."""
    try:
        return mended(validation)
    except DataError as error:
        raise SecondRecordingError(error.code, f"in the second recording: {error.message}") from error


@contextmanager
def _of_second() -> Iterator[None]:
    """What is raised inside is of the second recording, and says so by its kind; its words do by themselves."""
    try:
        yield
    except DataError as error:
        raise SecondRecordingError(error.code, error.message) from error


@_of_second()
def validated(
    explanation: Explanation, prepared: Prepared, selection: Selection, second: Comparison, *, by_model: bool
) -> Explanation:
    """The explanation with its figures on a second recording, and what was left out of that. by_model: whether the
    given simulation is a model, which is simulated there like the others.

    Its further signals all stay: a read-back among them moves nothing, for no part of the first record is driven by it.
    A limit of PV that the model has too is simulated, and compared like the rest.
    """
    taken = taken_of(second)
    second = as_compared(second, taken)
    record = record_of(second) if taken is None else taken.timed(record_of(second))
    sensors = tuple(pattern.part for pattern in prepared.patterns)
    simulated = {part.block.name for part in lasting(sensors)}
    hidden = tuple(pattern for pattern in find_patterns(record) if pattern.part.block.name not in simulated)
    record = without_hidden(record, hidden)
    given = prepared.given if by_model else second.trace if prepared.given_trace is not None else None
    rest = rest_along(prepared, record, second.trace)
    lacking = rest_unknown(prepared, selection.fit) if rest is None else Lacking()
    record = record if rest is None else record.resting(rest)
    judged = None if lacking.too_much else validate(prepared.base, selection.fit, sensors, record, given)
    said = tuple(Reason(note.code, f"in the second recording: {note.text}") for note in second.notes)
    said += _far_apart(prepared.record, record)
    said += _given_on_one_alone(prepared.given_trace is not None, given is not None or second.trace is not None)
    return replace(explanation, validation=judged, evidence=(*explanation.evidence, *said, *lacking.said))


def _far_apart(first: Experiment, second: Experiment) -> tuple[Reason, ...]:
    """That a second recording is hardly of the same loop in the same units, by its OP and PV."""
    sides = (("OP", first.op, second.op), ("PV", first.pv, second.pv))
    said = [
        f"{name} runs {_in_range(two)}, in the first {_in_range(one)}"
        for name, one, two in sides
        if _elsewhere(one, two)
    ]
    if not said:
        return ()
    text = f"the second recording is far from the first: {'; '.join(said)}; is it of the same loop, in the same units?"
    return (Reason("second_elsewhere", text),)


def _elsewhere(one: FloatArray, other: FloatArray) -> bool:
    """Whether two signals go OTHER_UNIT times as far as each other, or are farther apart than that."""
    wide, narrow = sorted((span(one), span(other)), reverse=True)
    return wide > OTHER_UNIT * narrow or abs(float(np.median(one) - np.median(other))) > OTHER_UNIT * wide


def _in_range(signal: FloatArray) -> str:
    low, high = np.quantile(signal, (0.01, 0.99))
    return f"from {low:.4g} to {high:.4g}"


def _given_on_one_alone(first: bool, second: bool) -> tuple[Reason, ...]:
    """Why nothing is said of a simulation as it came on the second recording, where it is there of one alone."""
    if first == second:
        return ()
    has, lacks = ("first", "second") if first else ("second", "first")
    text = f"there is a simulation for the {has} recording but none for the {lacks}: it is not judged on the second"
    return (Reason("given_not_validated", text),)
