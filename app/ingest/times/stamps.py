"""Time stamps: which form a column has, and texts of it to nanoseconds since 1970."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal
from zoneinfo import ZoneInfo

import numpy as np
import polars as pl

from app.errors import DataError
from app.ingest.model import NO_TIME, IngestOptions, TimeArray
from app.ingest.remembering import remembered
from app.ingest.times.counted_times import NUMBER, WALL_SCALES, are_stamps_of_digits, find_count
from app.ingest.times.date_order import AMBIGUOUS, Reading, choose
from app.ingest.times.digit_clocks import BEHIND_DATE, UNKNOWN, digits_of, go_one_way, with_clock
from app.ingest.times.formats import OF_HOURS, formats, of_shape, with_minutes
from app.ingest.times.midnights import MIDNIGHT
from app.ingest.times.spelled_times import respelled, tells_utc
from app.ingest.times.told_zones import told_utc_offset_ns, told_zone, zone_in_letters
from app.nanoseconds import NS_PER_DAY, NS_PER_S

FIRST_YEAR, LAST_YEAR = 1971, 2199
FIRST_NS, END_NS = (np.datetime64(f"{year}", "ns").astype(np.int64) for year in (FIRST_YEAR, LAST_YEAR + 1))
SAMPLE = 400
LEAST_SHARE = 0.5  # of a sample of a column of times that is readable
DAMAGED_SHARE = 0.02  # of a sample, that may tell an order of day, month and year by damage alone
LONGEST_KEPT = 1 << 16
"""Characters of a sample with its name whose form is kept: comments would stay in memory by the MB."""

Kind = Literal["text", "relative", "epoch", "epoch_pair", "serial"]

_PAIR = re.compile(r"\d{9,11}:\d{1,9}")
_DIGIT = re.compile(r"\d")
_DECIMAL_COMMA = r"(:\d{2}),(\d)"
_MAY_BE_STAMP = re.compile(r"\d\D+\d|\d{6}")
"""A day and something of a month, a year or a clock, two numbers apart or many digits in one, however it is spelled: a
cheap test before the dear ones."""
_BEHIND_SECONDS = "|".join(rf"(?<=:\d{{2}}[.,]\d{{{digits}}})" for digits in range(1, 10))
_ZONE = re.compile(rf"(Z|(?:(?<=:\d{{2}})|{_BEHIND_SECONDS})[+-]\d{{2}}|[+-]\d{{2}}:?\d{{2}})$")


@dataclass(frozen=True)
class TimeForm:
    """How a column of times is read.

    kind: "text" (`format`), "relative" (seconds from a start), "epoch" (a number since 1970), "epoch_pair"
        (seconds:nanoseconds), "serial" (days since 1899-12-30 or since year 0, of a clock on the wall).
    scale: nanoseconds a unit of a number. origin_ns: of its zero, since 1970. rounding_ns: what its times are
        rounded to.
    utc_offset_ns: of the zone that the column's name tells; None where it tells none.
    from_clock: numbers count from a start that the file tells by a clock on the wall.
    spelled: `format` is that of the text as `respelled`. decimal_comma: of the text with a point before the decimals of
        its seconds.
    clock_digits: of clocks of digits alone behind a date, with their zeros; `format` is that of the text with colons
        between them. hours_apart: the hours stand in a column of their own.
    resolution_ns: the smallest step that the text can show.
    rivals: other formats that fit the sample equally well.
    """

    kind: Kind
    format: str = ""
    scale: float = 1e9
    origin_ns: int = 0
    rounding_ns: int = 100
    zoned: bool = False
    utc_offset_ns: int | None = None
    zone: str = ""
    from_clock: bool = False
    spelled: bool = False
    decimal_comma: bool = False
    clock_digits: int = UNKNOWN
    hours_apart: bool = False
    resolution_ns: int = 1
    rivals: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def zone_in_file(self) -> bool:
        counted = self.kind in ("epoch", "epoch_pair") and not self.from_clock
        return self.zoned or self.utc_offset_ns is not None or self.zone != "" or counted

    @property
    def is_date(self) -> bool:
        """Without a clock."""
        return self.kind == "text" and "%H" not in self.format and "%I" not in self.format

    @property
    def is_of_hours(self) -> bool:
        """With a clock of hours alone."""
        return self.kind == "text" and self.format.endswith(OF_HOURS)

    @property
    def shown(self) -> str:
        return {
            "text": self.format,
            "relative": "relative, s",
            "epoch": "seconds from a start" if self.from_clock else "epoch",
            "epoch_pair": "epoch:ns",
            "serial": "serial days",
        }[self.kind]


def check_time_zone(name: str) -> None:
    """Raises DataError("unknown_time_zone") where it names none."""
    try:
        ZoneInfo(name)
    except (ValueError, OSError, LookupError) as error:
        raise DataError("unknown_time_zone", f"{name!r} is no time zone; an IANA name is needed") from error


def find_form(sample: list[str], name: str, options: IngestOptions, clock_digits: int = UNKNOWN) -> TimeForm | None:
    """The form of a column from some of its fields in order of the rows; None where they are no times. clock_digits: of
    clocks of digits alone, where these are told."""
    texts = _written(tuple(sample[:SAMPLE]))
    if not _have_digits(texts):
        return None
    form = (_number_form(texts, name) if _are_numbers(texts) else None) or _form_of(texts, options, clock_digits)
    return form and with_told_zone(form, name)


def with_told_zone(form: TimeForm, name: str) -> TimeForm:
    """In the zone that the column's name tells, where its times tell none."""
    offset_ns, zone = told_utc_offset_ns(name), told_zone(name)
    if form.zoned or form.kind not in ("text", "serial"):
        return form
    if offset_ns is None and not zone:
        letters = zone_in_letters(name)
        note = f"times are in the set zone: {letters} in the name of their column tells nothing of summer time"
        return replace(form, notes=(note, *form.notes)) if letters else form
    note = f"times are in the zone that the name of their column tells: {name.strip()[:80]!r}"
    return replace(form, utc_offset_ns=offset_ns, zone=zone, notes=(note, *form.notes))


def _have_digits(sample: Sequence[str]) -> bool:
    return any(character.isdigit() for text in sample[:20] for character in text)


@remembered(256, LONGEST_KEPT)
def _written(texts: tuple[str, ...]) -> tuple[str, ...]:
    """What is not blank, without quotes. This and what follows are kept, because each layout asks the same columns of a
    file, by names of its own, whether they hold times."""
    return tuple(text for text in map(normal, texts) if text)


@remembered(256, LONGEST_KEPT)
def _are_numbers(sample: tuple[str, ...]) -> bool:
    return _share(NUMBER, sample) > 0.8


@remembered(256, LONGEST_KEPT)
def _form_of(sample: tuple[str, ...], options: IngestOptions, clock_digits: int) -> TimeForm | None:
    if _share(_PAIR, sample) > 0.8:
        return TimeForm("epoch_pair")
    if _share(BEHIND_DATE, sample) > 0.8 and not all(map(_is_of_hour, sample)):
        return _digits_form(sample, options, clock_digits)
    form = _text_form(sample, options)
    if form is not None or (_are_numbers(sample) and not are_stamps_of_digits(sample)):
        return form
    return _comma_form(sample, options) or _spelled_form(sample, options)


def _is_of_hour(stamp: str) -> bool:
    return len(stamp.rpartition(" ")[2]) <= 2  # digits


def _digits_form(sample: Sequence[str], options: IngestOptions, told: int) -> TimeForm | None:
    """Without their zeros, these would be read as other clocks: 10000 as 10:00:00."""
    digits = digits_of(sample, told)
    if digits <= UNKNOWN or not go_one_way(sample):
        return None
    form = _text_form(with_clock(pl.Series(sample, dtype=pl.String), digits).to_list(), options)
    return form and replace(form, clock_digits=digits)


def normal(text: str) -> str:
    return text.strip().strip('"').strip()


def _share(pattern: re.Pattern[str], sample: Sequence[str]) -> float:
    return sum(bool(pattern.fullmatch(text)) for text in sample) / len(sample)


@remembered(256, LONGEST_KEPT)
def _number_form(sample: tuple[str, ...], name: str) -> TimeForm | None:
    count = find_count(sample, name)
    if count is None:
        return None
    kind: Kind = "relative" if count.origin_ns is None else "serial" if count.scale in WALL_SCALES else "epoch"
    return TimeForm(
        kind, scale=count.scale, origin_ns=count.origin_ns or 0, rounding_ns=count.rounding_ns, notes=count.notes
    )


def _comma_form(sample: Sequence[str], options: IngestOptions) -> TimeForm | None:
    """Of seconds with a decimal comma, as ISO 8601 allows them."""
    if not any(re.search(_DECIMAL_COMMA, text) for text in sample):
        return None
    form = _text_form(with_point(pl.Series(sample, dtype=pl.String)).to_list(), options)
    return form and replace(form, decimal_comma=True)


def with_point(texts: pl.Series) -> pl.Series:
    return texts.str.replace(_DECIMAL_COMMA, "${1}.${2}")


def as_formatted(texts: pl.Series, form: TimeForm) -> pl.Series:
    """Stamps in the writing that the form's `format` is of."""
    if form.clock_digits:
        return with_clock(texts, form.clock_digits)
    if form.spelled:
        return respelled(texts)
    return with_point(texts) if form.decimal_comma else texts


def _spelled_form(sample: Sequence[str], options: IngestOptions) -> TimeForm | None:
    """A dotted a.m. is no American one."""
    if not any(_MAY_BE_STAMP.search(text) for text in sample):
        return None
    texts = pl.Series(sample, dtype=pl.String)
    form = _text_form(respelled(texts).to_list(), options, _american(sample))
    if form is None:
        return None
    notes = ("UTC or GMT stands behind the times, and they were read so",) if tells_utc(texts) else ()
    return replace(form, spelled=True, notes=(*notes, *form.notes))


def _text_form(sample: Sequence[str], options: IngestOptions, american: bool | None = None) -> TimeForm | None:
    zoned = sum(bool(_ZONE.search(text)) and len(text) > 12 for text in sample) > 0.8 * len(sample)
    series = pl.Series(sample, dtype=pl.String)
    fits: list[tuple[float, Reading]] = []
    for candidate in _candidates(sample, zoned, _american(sample) if american is None else american):
        times = parse_text(series, candidate, zoned)
        share = float(np.mean(times != NO_TIME))
        if share >= (LEAST_SHARE if not candidate.endswith(OF_HOURS) else 1.0 - DAMAGED_SHARE):
            fits.append((share, Reading(candidate, times, times != NO_TIME)))
    if not fits:
        return None
    best = max(share for share, _ in fits)
    fitting = [reading for share, reading in fits if share >= best - 1e-9]
    if all(reading.format.startswith(AMBIGUOUS) for reading in fitting):  # a damaged stamp may fit a wrong order alone
        fitting = [r for share, r in fits if share >= best - DAMAGED_SHARE and r.format.startswith(AMBIGUOUS)]
    return _choose(fitting, zoned, options)


def _candidates(sample: Sequence[str], zoned: bool, american: bool) -> list[str]:
    """By the shape of a few; one of them may be written otherwise than the others, with a T before its clock too."""
    probe = next((text for text in sample if any(c.isdigit() for c in text)), sample[0])
    probes = {_ZONE.sub("", text) if zoned else text for text in (probe, *sample[:3], sample[-1])}
    shaped = [text for text in probes if _MAY_BE_STAMP.search(text)]
    found: list[str] = []
    for separator in sorted({_separator(text) for text in shaped}):
        fitting = {form for text in shaped for form in of_shape(_DIGIT.sub("0", text), separator)}
        found += [form for form in formats(separator, american) if form in fitting and form not in found]
    return found


def _separator(text: str) -> str:
    return "T" if re.search(r"\dT\d", text) else " "


def _american(sample: Sequence[str]) -> bool:
    """Where nothing else tells: a clock of twelve hours or a month without its zero stands with the month first."""
    american = (bool(re.match(r"\d[/-]", text) or re.search(r"\d\s*[AaPp][Mm]\b", text)) for text in sample)
    return sum(american) > DAMAGED_SHARE * len(sample)


def _choose(fits: list[Reading], zoned: bool, options: IngestOptions) -> TimeForm:
    """The first format that fits, but between orders of day, month and year."""
    doubtful = [fit for fit in fits if fit.format.startswith(AMBIGUOUS)]
    if not doubtful or len(doubtful) < len({fit.format[:8] for fit in fits}):
        return TimeForm("text", fits[0].format, zoned=zoned, resolution_ns=_resolution(fits[0].format))
    found = choose(doubtful, options)
    return TimeForm(
        "text",
        found.format,
        zoned=zoned,
        resolution_ns=_resolution(found.format),
        rivals=found.rivals,
        notes=found.notes,
    )


def _resolution(text: str) -> int:
    if "%.f" in text:
        return 1
    if "%S" in text:
        return NS_PER_S
    return (60 if "%M" in text else 3600 if "%H" in text else 86400) * NS_PER_S


def parse_text(texts: pl.Series, form: str, zoned: bool) -> TimeArray:
    """(n,) ns since 1970, as written or, with an offset, in UTC; NO_TIME where the text does not fit or the year is
    absurd. 24:00 is the midnight that ends its day."""
    times = _parsed(texts, form, zoned)
    if "%H" in form and (times == NO_TIME).any():
        left = np.flatnonzero(times == NO_TIME)
        ends = left[texts[left].str.contains(MIDNIGHT).fill_null(False).to_numpy()]
        begins = _parsed(texts[ends].str.replace(MIDNIGHT, "${1}00${2}"), form, zoned)
        times[ends] = np.where(begins == NO_TIME, NO_TIME, begins + NS_PER_DAY)
    return times


def _parsed(texts: pl.Series, form: str, zoned: bool) -> TimeArray:
    if form.endswith(OF_HOURS):  # polars reads no hours alone
        if zoned:
            return np.full(len(texts), NO_TIME)
        texts, form = with_minutes(texts, form)
    if zoned:
        parsed = texts.str.to_datetime(form + "%#z", strict=False, time_unit="us").dt.replace_time_zone(None)
    elif "%H" not in form and "%I" not in form:
        parsed = texts.str.to_date(form, strict=False).cast(pl.Datetime("us"))
    else:
        parsed = texts.str.to_datetime(form, strict=False, time_unit="us")
    # Microseconds, the smallest of all where there is none: years that are far off have no nanoseconds.
    ticks = parsed.to_numpy().view(np.int64)
    return np.where((ticks >= FIRST_NS // 1000) & (ticks < END_NS // 1000), ticks * 1000, NO_TIME)
