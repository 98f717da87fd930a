"""What the page of a loop and its report both tell of it and of its newest verdict."""

from collections.abc import Mapping
from typing import Any

from app.services import loops
from app.services.backend import Backend
from app.services.plant import glossary, loop_verdicts
from app.services.plant.arrivals import newest_in_words
from app.services.plant.before_after import compared, newest_repair
from app.services.plant.groups import groups_of, shaken_by, shown
from app.services.plant.judged import judged
from app.services.plant.periods import periods
from app.services.plant.stood_together import as_one
from app.services.stating.continuing import goes_on_as
from app.services.stating.shelving import Shelf
from app.services.telling.next_steps import behind_source
from app.services.telling.rival_wording import why_first
from app.services.telling.size_wording import size_in_words
from app.services.telling.why_rely import contradiction, derivative, names_otherwise, older_said, points
from app.storage.loops import LoopRow

NIGHTS = 60


def loop_head(backend: Backend, found: LoopRow, shelved: Shelf) -> dict[str, Any]:
    """By the names of the templates, what both tell of a loop whether it was ever audited or not."""
    it = loops.view_of(found)
    return {
        "it": it,
        "newest": newest_in_words(it.samples_to, backend.clock),
        "shelved": shelved.of(it.tag),
        "goes_on_as": goes_on_as(backend, it.tag),
        "failure": loop_verdicts.newest_failure(backend, found),
    }


def loop_sheet(
    backend: Backend, found: LoopRow, explained: Mapping[str, Any] | None, shelved: Shelf | None = None
) -> dict[str, Any]:
    """By the names of the templates. explained: the newest explanation of the loop; shelved: None: as of now. Raises
    NotFoundError where it was never audited.
    """
    it = loops.view_of(found)
    row = loop_verdicts.loop_health(backend, it.tag, shelved)
    detail = loop_verdicts.verdict_detail(backend, found, row["audit_id"])
    repair = newest_repair(backend, found)
    together = shown(backend)
    mine = groups_of(together.groups, it.tag)
    shaking = shaken_by(mine, row)
    disputed = (row, explained, row["repaired_at"], backend.settings.hold_days)
    return {
        "it": it,
        "row": row,
        "detail": detail,
        "disagrees": contradiction(*disputed) or names_otherwise(*disputed),
        "older_said": older_said(*disputed, backend.clock),
        "points": points(row, detail, shaking),
        "derivative": derivative(row, explained),
        "size": size_in_words(row, detail),
        "judged": judged(backend, [it.tag]).get(it.tag),
        "periods": periods(backend, found, row, detail),
        "why_first": why_first(detail.get("rivals", ()), row["rival_winner"]),
        "groups_known": together.groups is not None,
        "groups_before": together.before,
        "figures": [told for told in glossary.figures(row, it.pv_unit) if told[1] is not None],
        "most_nights": NIGHTS,
        "history": loop_verdicts.chained_history(backend, found, NIGHTS),
        "groups": mine,
        "shaken_by": shaking,
        "behind_source": None if shaking is None else behind_source(row["next_step"]),
        "stood_with": _stood_with(backend, row),
        "repair": repair,
        "compared": compared(backend, found, repair, it.pv_unit),
    }


def _stood_with(backend: Backend, row: Mapping[str, Any]) -> list[str]:
    """The loops that came to stand with this one, the weightiest first, whether they are shelved or not."""
    found = as_one(backend).of(row["loop"]) if row["stood_with"] else None
    return [] if found is None else [tag for tag in found.loops if tag != row["loop"]]
