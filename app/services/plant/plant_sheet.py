"""What the page of the plant and its report both tell."""

from typing import Any

from app.services.backend import Backend
from app.services.plant import groups
from app.services.plant.arrivals import Arrivals
from app.services.plant.changes import changes
from app.services.plant.listing import listing
from app.services.plant.newest_run import newest_run as newest_run_of
from app.services.plant.overview import overview
from app.services.plant.repaired import repairs
from app.services.plant.silent import of_now
from app.services.recency import LATE


def plant_sheet(backend: Backend, reach: Arrivals) -> dict[str, Any]:
    """By the names of the templates. reach: `arrivals` of now."""
    seen, by = overview(backend), listing(backend, reach.current_ns)
    changed = changes(backend, together=by.together)
    found = groups.shown(backend)
    newest_run = None if changed.run_id is None else int(changed.run_id)
    return {
        "seen": seen,
        "changed": changed,
        "listing": by,
        "together": by.together,
        "arrivals": of_now(backend, newest_run, reach) if seen.audited else [],
        "late_days": LATE.days,
        "newest_run": newest_run_of(backend),
        "groups_known": found.groups is not None,
        "groups_before": found.before,
        "repairs": repairs(backend),
        "shelf": by.shelf,
        "groups": groups.surely_together(found.groups),
    }
