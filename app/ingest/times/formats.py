"""The formats that stamps of digits and named months can have, and which of them a text can be of by its shape."""

import re
from functools import lru_cache

import polars as pl

from app.ingest.remembering import remembered
from app.ingest.times.date_order import DAY_FIRST, MONTH_FIRST, YEAR_FIRST

_ISO = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y%m%d")
_OTHER = ("%d.%m.%Y", "%d.%m.%y", "%d-%b-%y", "%d-%b-%Y", "%d %b %Y", "%d/%b/%Y", "%d/%b/%y", "%b %d %Y", "%b %d, %Y")
_TIMES = (
    " %H:%M:%S",
    " %H:%M:%S%.f",
    " %H:%M",
    " %I:%M:%S %p",
    " %I:%M %p",
    " %I:%M:%S%.f %p",
    " %H.%M.%S",
    "%H%M%S",
    "%H%M%S%.f",
    " %H%M%S",
    " %H%M%S%.f",
    " %H",
    " %I %p",
    "",
)
_PARTS = {"%Y": r"\d{4}", "%b": "[a-z]{3}", "%p": "[ap]m", "%.f": r"(\.\d+)?"}
_PARTS |= {"%j": r"\d{3}"}
_PARTS |= dict.fromkeys(("%m", "%d", "%H", "%I", "%M"), r" ?\d{1,2}") | dict.fromkeys(("%y", "%S"), r"\d{2}")
_DAY_OF_YEAR = "%Y-%j"
OF_HOURS = ("%H", "%I %p")
"""How the formats of clocks of hours alone end."""
LONGEST_PROBE = 64
"""Characters of a text with its separator whose formats are kept."""


@lru_cache
def formats(separator: str, american: bool) -> tuple[str, ...]:
    """All that are known, in the order of preference."""
    dates = [*_ISO, *_OTHER, *DAY_FIRST]
    at = len(dates) if not american else len(_ISO) + len(_OTHER)
    dates = [*dates[:at], *MONTH_FIRST, *dates[at:], *YEAR_FIRST]
    found = tuple(
        date + time.replace(" ", separator, 1) if time.startswith(" ") else date + time
        for date in dates
        for time in _TIMES
    )
    # without a clock, or in one word with it, it may be the number of anything
    return (*found, *(_DAY_OF_YEAR + time.replace(" ", separator, 1) for time in _TIMES if time.startswith(" ")))


@remembered(1024, LONGEST_PROBE)
def of_shape(probe: str, separator: str) -> tuple[str, ...]:
    """Formats that a text, all of whose digits are one, can be of: which digits they are tells no shape."""
    return tuple(form for form in formats(separator, american=False) if _shape(form).fullmatch(probe))


@lru_cache(maxsize=1024)
def _shape(form: str) -> re.Pattern[str]:
    """What a format can look like: a cheap test before the exact one."""
    parts = re.split(r"(%\.f|%[a-zA-Z])", form)
    return re.compile("".join(_PARTS.get(part, re.escape(part)) for part in parts), re.IGNORECASE)


def with_minutes(texts: pl.Series, form: str) -> tuple[pl.Series, str]:
    """Stamps with hours alone, and their format, with minutes behind the hours."""
    if form.endswith("%H"):
        return texts + ":00", form + ":%M"
    return texts.str.replace(r"(?i) ([ap]m)$", ":00 ${1}"), form.replace("%I", "%I:%M")
