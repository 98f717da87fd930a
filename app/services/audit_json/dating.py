"""Seconds of a record in calendar time."""

from datetime import datetime, timedelta
from typing import Any

from app.engine.long_records.episodes import BEGAN, ENDED, SPELL, episode_text
from app.services.moments import PlantClock, iso_utc


def dated(line: dict[str, Any], origin: datetime, clock: PlantClock) -> dict[str, Any]:
    """The line with its episodes, and since when nothing answers, in calendar time; in the reasons as the plant's clock
    showed it."""
    episodes = [
        episode | {side: iso_utc(instant(origin, round(episode[f"{side}_s"]))) for side in ("start", "end")}
        for episode in line["episodes"]
    ]
    reliable = [episode for episode in episodes if episode["reliability"] == "reliable"]
    first, last = reliable[:1], reliable[-1:]
    told = {SPELL: iter(reliable), ENDED: iter(first), BEGAN: iter(last)}
    reasons = [
        reason | {"text": _episode_text(reason["code"], next(told[reason["code"]]), clock)}
        if reason["code"] in told
        else reason
        for reason in line["reasons"]
    ]
    unanswered_since = iso_utc(instant(origin, line["unanswered_since_s"]))
    return line | {"episodes": episodes, "reasons": reasons, "unanswered_since": unanswered_since}


def _episode_text(code: str, episode: dict[str, Any], clock: PlantClock) -> str:
    start, end = (clock.told(episode[side]) for side in ("start", "end"))
    return episode_text(code, episode["probability"], start, end)


def instant(origin: datetime, seconds: float | None) -> datetime | None:
    return None if seconds is None else origin + timedelta(seconds=seconds)
