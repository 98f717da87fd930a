"""Which loops a table or a file of reports is of, in words: what is printed has no form above it."""

from collections.abc import Iterator

from app.services.telling.health_classes import health_words
from app.services.telling.wording import RELIABILITY_BRIEF, VERDICT_WORDS, cause_words
from app.storage.asked_rows import RowFilter

WHEN_JUDGED = {**RELIABILITY_BRIEF, "reliable": "reliable when judged"}
"""By which rows are filtered: those of old records, and from before a repair, are among them, and say so."""


def asked_words(asked: RowFilter) -> str:
    """ "valve sticks; rely on it; of unit CRUDE"; empty where all loops in service are meant."""
    return "; ".join([*_of_verdicts(asked), *_of_loops(asked)])


def _of_verdicts(asked: RowFilter) -> Iterator[str]:
    if asked.verdict:
        yield " or ".join(VERDICT_WORDS.get(one, one) for one in asked.verdict)
    if asked.reliability:
        yield WHEN_JUDGED.get(asked.reliability, asked.reliability)
    if asked.likely_cause:
        yield f"likely cause: {cause_words(asked.likely_cause)}"
    if asked.table2_reading:
        yield f"table 2: {asked.table2_reading.replace('_', ' ')}"
    if asked.health is not None:
        yield f"health {health_words(*asked.health)}"
    if asked.min_probability is not None:
        yield f"probability of {asked.min_probability:g} or more"


def _of_loops(asked: RowFilter) -> Iterator[str]:
    for words, value in (("of unit", asked.unit), ("of type", asked.type), ("looked after by", asked.owner)):
        if value:
            yield f"{words} {value}"
    if asked.no_unit is not None:
        yield "that name no unit" if asked.no_unit else "that name a unit"
    if asked.search:
        yield f"with \u201c{asked.search}\u201d in tag, description or owner"
    if asked.open_order is not None:
        yield f"{'with' if asked.open_order else 'without'} an open work order"
    if asked.retired is not False and asked.audit_id is None:
        yield "retired" if asked.retired else "retired or not"
