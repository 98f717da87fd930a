"""Reads columns of time stamps of a known form: to nanoseconds since 1970 UTC."""

import re
from typing import cast

import numpy as np
import polars as pl

from app.ingest.model import NO_TIME, FloatArray, IngestOptions, TimeArray
from app.ingest.times.date_order import in_other_order
from app.ingest.times.half_clock import HalfClock
from app.ingest.times.midnights import without_begins
from app.ingest.times.spelled_times import respelled
from app.ingest.times.stamps import (
    END_NS,
    FIRST_NS,
    FIRST_YEAR,
    LAST_YEAR,
    TimeForm,
    as_formatted,
    parse_text,
    with_point,
)
from app.ingest.times.wall_clock import WallClock
from app.nanoseconds import NS_PER_S


class TimeReader:
    """Reads columns of one form, chunk by chunk; local time goes to UTC, in the order of the rows (see
    `WallClock`): each chunk is read once, or `clock.before` set back."""

    def __init__(self, form: TimeForm, options: IngestOptions) -> None:
        self.form = form
        self._told_ns = form.utc_offset_ns
        self._zone = form.zone or options.time_zone
        self.clock = WallClock(self._zone if self._told_ns is None else "UTC")
        self.half_clock = HalfClock()
        self.in_other_order = 0  # dates that can be read with day and month exchanged alone
        self._options = options

    @property
    def wall_zone(self) -> str:
        """The zone of the clock that the times were read from; UTC where they tell one."""
        local = self.form.kind in ("text", "serial") and not self.form.zoned and self._told_ns is None
        return self._zone if local else "UTC"

    def read(self, texts: pl.Series) -> TimeArray:
        """(n,) ns since 1970 UTC, NO_TIME where a row has no readable time."""
        if isinstance(texts.dtype, pl.Datetime):
            return self._typed(texts)
        if isinstance(texts.dtype, pl.Categorical) and len(texts):
            return self._repeated(texts)
        return self._in_utc(self._as_written(texts))

    def _repeated(self, texts: pl.Series) -> TimeArray:
        """Texts that have numbers: each is read once, and goes to UTC in the order of the rows."""
        of_rows = texts.to_physical()
        if of_rows.null_count():
            of_rows = of_rows.fill_null(cast("int", of_rows.max() or 0) + 1)
        numbers = of_rows.to_numpy()
        starts = np.flatnonzero(np.concatenate(([True], numbers[1:] != numbers[:-1])))  # of runs of one text
        row_of = np.zeros(int(np.max(numbers)) + 1, dtype=np.intp)
        row_of[numbers[starts]] = starts
        each = self._as_written(texts[row_of].cast(pl.String))
        return np.repeat(self._in_utc(each[numbers[starts]]), np.diff(starts, append=len(numbers)))

    def _as_written(self, texts: pl.Series) -> TimeArray:
        if self.form.kind == "epoch_pair":
            return _pairs(texts)
        return self._texts(texts) if self.form.kind == "text" else self._numbers(texts)

    def _in_utc(self, times: TimeArray) -> TimeArray:
        local = self.form.kind in ("text", "serial") and not self.form.zoned
        if local and "%H" in self.form.format:
            self.half_clock.look(times)
        return self._from_wall(times) if local else times

    def _from_wall(self, times: TimeArray) -> TimeArray:
        return self.clock.to_utc(times) if not self._told_ns else _shifted(times, -self._told_ns)

    def _to_wall(self, times: TimeArray) -> TimeArray:
        return from_utc(times, self._zone) if self._told_ns is None else _shifted(times, self._told_ns)

    def _typed(self, times: pl.Series) -> TimeArray:
        """A column that holds times already (parquet)."""
        zoned = isinstance(times.dtype, pl.Datetime) and times.dtype.time_zone is not None
        plain = times.dt.convert_time_zone("UTC").dt.replace_time_zone(None) if zoned else times
        good = plain.dt.year().is_between(FIRST_YEAR, LAST_YEAR).fill_null(False)
        ticks = (
            pl.select(pl.when(good).then(plain))
            .to_series()
            .cast(pl.Datetime("ns"))
            .cast(pl.Int64)
            .fill_null(NO_TIME)
            .to_numpy()
        )
        return ticks if zoned else self._from_wall(ticks)

    def _texts(self, texts: pl.Series) -> TimeArray:
        texts = as_formatted(texts, self.form)
        times = parse_text(texts, self.form.format, self.form.zoned)
        missing = np.flatnonzero((times == NO_TIME) & texts.is_not_null().to_numpy())
        if len(missing):
            times = times.copy()
            times[missing] = self._odd(texts[missing])
            self._look_for_other_order(texts[missing].filter(pl.Series(times[missing] == NO_TIME)))
        return without_begins(texts, times)

    def _look_for_other_order(self, texts: pl.Series) -> None:
        other = in_other_order(self.form.format)
        if other and len(texts):
            found = self._of_forms(with_point(texts.str.strip_chars(' "')), other)
            self.in_other_order += int(np.count_nonzero(found != NO_TIME))

    def _odd(self, texts: pl.Series) -> TimeArray:
        """Rows in a slightly other form: blanks around them, with or without seconds or their fraction, a comma
        before that, an offset, or spelled otherwise."""
        texts = with_point(texts.str.strip_chars(' "'))
        times = self._of_forms(texts, self.form.format)
        left = np.flatnonzero(times == NO_TIME)
        if len(left) and not self.form.spelled:
            form = re.sub(r"^.*%b.*%([yY])", r"%d-%b-%\1", self.form.format)
            times[left] = self._of_forms(respelled(texts[left]), form)
        return times

    def _of_forms(self, texts: pl.Series, form: str) -> TimeArray:
        times = np.full(len(texts), NO_TIME)
        base = form.replace("%.f", "")
        with_fraction = base.replace("%S", "%S%.f")
        without_seconds = base.replace(":%S", "")
        with_seconds = base.replace("%H:%M", "%H:%M:%S") if "%S" not in base else base
        for variant in (base, with_fraction, without_seconds, with_seconds):
            for zoned in (self.form.zoned, not self.form.zoned):
                if not zoned and self.form.zoned:
                    continue
                found = parse_text(texts, variant, zoned)
                if zoned and not self.form.zoned:
                    found = self._to_wall(found)
                times = np.where(times == NO_TIME, found, times)
        return times

    def _numbers(self, texts: pl.Series) -> TimeArray:
        numbers = to_numbers(texts)
        form, origin = self.form, self._options.start_ns if self.form.kind == "relative" else 0
        numbers = numbers + form.origin_ns / form.scale
        with np.errstate(over="ignore"):
            scaled = numbers * form.scale
        good = np.isfinite(scaled) & (np.abs(scaled + origin) < 7.2e18)
        whole = np.floor(np.where(good, numbers, 0.0))
        part = np.where(good, numbers, 0.0) - whole
        # a double of ns since 1970 is 256 ns off
        ticks = whole.astype(np.int64) * round(form.scale) + _rounded(part * form.scale, form.rounding_ns)
        ticks = ticks if form.scale >= form.rounding_ns else _rounded(whole * form.scale, form.rounding_ns)
        times = np.where(good, ticks + origin, NO_TIME)
        return times if form.kind == "relative" else _in_known_years(times)


def _in_known_years(times: TimeArray) -> TimeArray:
    return np.where((times >= FIRST_NS) & (times < END_NS), times, NO_TIME)


def _rounded(nanoseconds: FloatArray, to_ns: int) -> TimeArray:
    """To what doubles keep of them: seconds since 1970 that have decimals are 238 ns apart in our time."""
    return np.rint(nanoseconds / to_ns).astype(np.int64) * to_ns


def to_numbers(texts: pl.Series) -> FloatArray:
    """(n,) numbers of texts, NaN where there is none; numbers stay what they are."""
    if texts.dtype != pl.String:
        return texts.cast(pl.Float64).to_numpy()
    return texts.str.strip_chars(' "').str.replace(",", ".", literal=True).cast(pl.Float64, strict=False).to_numpy()


def _pairs(texts: pl.Series) -> TimeArray:
    parts = texts.str.strip_chars(' "').str.split_exact(":", 1).struct.unnest()
    seconds = parts.to_series(0).cast(pl.Int64, strict=False)
    nanoseconds = parts.to_series(1).cast(pl.Int64, strict=False)
    good = (seconds.is_between(0, 7_000_000_000) & nanoseconds.is_between(0, NS_PER_S - 1)).fill_null(False).to_numpy()
    ticks = seconds.fill_null(0).to_numpy() * np.int64(good) * NS_PER_S + nanoseconds.fill_null(
        0
    ).to_numpy() * np.int64(good)
    return _in_known_years(np.where(good, ticks, NO_TIME))


def _shifted(times: TimeArray, by_ns: int) -> TimeArray:
    return np.where(times == NO_TIME, NO_TIME, times + by_ns)


def from_utc(times: TimeArray, zone: str) -> TimeArray:
    if zone == "UTC":
        return times
    good = times != NO_TIME
    there = (
        pl.Series(np.where(good, times, 0))
        .cast(pl.Datetime("ns"))
        .dt.replace_time_zone("UTC")
        .dt.convert_time_zone(zone)
    )
    return np.where(good, there.dt.replace_time_zone(None).cast(pl.Int64).to_numpy(), NO_TIME)
