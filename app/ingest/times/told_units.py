"""The unit of a column's times by its name, as in `time_ms`, `Time (min.)`, `Zeit [Std]`, `time/h` or `TimeMs`."""

import re
from dataclasses import dataclass

from app.ingest.remembering import remembered

_SPELLED = (
    (1e-9, r"ns|nsecs?|nanosec(?:ond)?s?|nanosekunden?"),
    (1e-6, r"[uμ]s|[uμ]secs?|microsec(?:ond)?s?|mikrosekunden?"),
    (1e-3, r"ms|msecs?|millis|millisec(?:ond)?s?|millisekunden?"),
    (1.0, r"s|secs?|seconds?|sek|sekunden?|secondes?|segundos?|secondi"),
    (60.0, r"mins?|minutes?|minuten?|minutos?|minuti"),
    (3600.0, r"h|hrs?|hours?|std|stunden?|heures?|horas?|ore"),
    (86400.0, r"d|days?|tage?|jours?|d[ií]as?|giorni"),
)
_UNITS = tuple((seconds, re.compile(words)) for seconds, words in _SPELLED)
_WORD = r"(?P<word>[^\W\d_]+)\.?"
_FORMS = tuple(
    re.compile(form)
    for form in (
        rf"\s*[\[(]\s*{_WORD}\s*[\])]$",
        rf"\s*/\s*{_WORD}$",
        rf"[_ .,\-]+(?!d$){_WORD}$",
        rf"(?<=time)(?![hds]$){_WORD}$",
        rf"^(?![hd]$){_WORD}$",
    )
)
_LONGEST = 40  # characters of a unit with what parts it from the name: names may be as long as lines
_BRACKETED = re.compile(r"[\[(]([^\[\]()]+)[\])]$")


@dataclass(frozen=True)
class ToldUnit:
    """A unit of `seconds`, in the name as `word`; `bare` is the name without it."""

    seconds: float
    word: str
    bare: str


@remembered(1 << 17)
def told_unit(name: str) -> ToldUnit | None:
    """None where the name tells none, as `Times`. A letter alone is one in brackets or behind a stroke; s and h behind
    `_` too."""
    folded = name.strip().casefold()  # which makes one mu of the two
    cut = max(len(folded) - _LONGEST, 0)
    for form in _FORMS:
        found = form.search(folded[cut:])
        seconds = found and next((seconds for seconds, words in _UNITS if words.fullmatch(found["word"])), None)
        if found and seconds:
            return ToldUnit(seconds, found["word"], folded[: cut + found.start()])
    return None


def unknown_unit(name: str) -> str:
    """What stands in brackets at the end of a name that tells no unit; empty where nothing does."""
    found = _BRACKETED.search(name.strip()[-_LONGEST:])
    return found[1].strip() if found and told_unit(name) is None else ""
