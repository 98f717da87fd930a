"""What the page of a loop and its report both tell of its newest verdict."""

from collections.abc import Mapping
from typing import Any

from app.services.backend import Backend
from app.services.plant import glossary, loops, notes
from app.services.plant.before_after import compared
from app.services.plant.groups import groups_of
from app.services.plant.judged import judged
from app.services.plant.periods import periods
from app.services.results import LoopView
from app.services.telling.rival_wording import why_first
from app.services.telling.size_wording import size_in_words
from app.services.telling.why_rely import contradiction, derivative, points

NIGHTS = 60


def loop_sheet(backend: Backend, it: LoopView, explained: Mapping[str, Any] | None) -> dict[str, Any]:
    """By the names of the templates. explained: the newest explanation of the loop. Raises NotFoundError where it was
    never audited.
    """
    row = loops.loop_health(backend, it.tag)
    detail = loops.verdict_detail(backend, it.tag)
    repair = notes.newest_repair(backend, it.tag)
    return {
        "it": it,
        "row": row,
        "detail": detail,
        "disagrees": contradiction(row, explained),
        "points": points(row, detail),
        "derivative": derivative(row, explained),
        "size": size_in_words(row, detail),
        "judged": judged(backend, [it.tag]).get(it.tag),
        "periods": periods(backend, it.tag, row, detail),
        "why_first": why_first(detail.get("rivals", ()), row["rival_winner"]),
        "figures": [told for told in glossary.figures(row, it.pv_unit) if told[1] is not None],
        "history": loops.chained_history(backend, it.tag, NIGHTS),
        "groups": groups_of(backend, it.tag),
        "repair": repair,
        "compared": compared(backend, it.tag, repair, it.pv_unit),
    }
