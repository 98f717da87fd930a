"""Times as machines take them."""

from datetime import datetime


def epoch_ms(moment: datetime | None) -> int | None:
    """Milliseconds since 1970, UTC: what dashboards take for a time."""
    return None if moment is None else round(moment.timestamp() * 1000)
