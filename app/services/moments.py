"""Times as people and machines take them: machines in UTC, people as the plant's clocks show them."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

EPOCH = datetime.fromtimestamp(0, UTC)
FIRST_DATED = datetime(1971, 1, 1, tzinfo=UTC)
"""No export is read to have dates before it: what stands there counts from a start that nobody told, each loop from its
own."""
FARTHEST_NS = 9 * 10**18
"""The years 1684 to 2255: in 64 bits, with room for the day before a time."""
NO_DATE = "no date"
AHEAD = timedelta(hours=1)
"""Samples farther ahead of the clock than this are kept, but not looked at: their clock is wrong."""


def epoch_ms(moment: datetime | None) -> int | None:
    """Whole milliseconds since 1970, UTC, those that `iso_utc` tells: what dashboards take for a time."""
    return None if moment is None else (moment - EPOCH) // timedelta(milliseconds=1)


def iso_utc(moment: datetime | None) -> str | None:
    """2026-01-31T03:00:00Z, with milliseconds only where there are any; what is below them is cut."""
    if moment is None:
        return None
    if moment.tzinfo is None:
        raise ValueError("a time without a zone cannot be told in UTC")
    utc = moment if moment.tzinfo is UTC else moment.astimezone(UTC)
    return utc.isoformat(timespec="milliseconds" if utc.microsecond else "seconds").removesuffix("+00:00") + "Z"


@dataclass(frozen=True)
class PlantClock:
    """What the clocks of the plant show, in the IANA zone `name`."""

    name: str

    def at(self, moment: datetime) -> datetime:
        """The same moment in the plant's zone; where the calendar has no day for it there, as it is. What has no date
        is in no zone: it counts from the first moment of 1970, which is not the last one of 1969 anywhere."""
        if moment < FIRST_DATED:
            return moment.astimezone(UTC)
        try:
            return moment.astimezone(ZoneInfo(self.name))
        except OverflowError:
            return moment

    def date(self, moment: datetime) -> str:
        """The day that it is there."""
        return self.at(moment).date().isoformat()

    def date_of_run(self, night: str | None, begun: datetime) -> str:
        """The date that a run counts for: of its night, which may begin after midnight, else the day that it began."""
        return night or self.date(begun)

    def short(self, iso: str | None) -> str:
        """2026-01-31T03:00:00Z as 2026-01-31 04:00 in Berlin, for places that say by which clock; a dash where there is
        none."""
        return self.at(datetime.fromisoformat(iso)).isoformat(" ", "minutes")[:16] if iso else "–"

    def to_the_second(self, iso: str) -> str:
        """2026-01-31 04:00:00, for places that say by which clock."""
        return self.at(datetime.fromisoformat(iso)).isoformat(" ", "seconds")[:19]

    def span(self, start: str, end: str, *, to_the_second: bool = False) -> str:
        """2026-01-31 04:00 to 04:10, the second day only where it is another one."""
        first, last = (self.to_the_second(at) if to_the_second else self.short(at) for at in (start, end))
        return f"{first} to {last.removeprefix(first[:11])}"

    def recorded(self, iso: str | None) -> str:
        """The same of a sample: "no date" where nobody told it, nothing where there is none."""
        return self.short(iso) if iso and self.dated(iso) else self.day(iso)

    @staticmethod
    def dated(iso: str) -> bool:
        """Whether a sample's time is one that somebody told."""
        return datetime.fromisoformat(iso) >= FIRST_DATED

    def day(self, iso: str | None) -> str:
        """The day alone; "no date" where nobody told it, nothing where there is no time."""
        if iso is None:
            return ""
        return self.date(datetime.fromisoformat(iso)) if self.dated(iso) else NO_DATE

    def told(self, iso: str) -> str:
        """The same with what the clock is ahead of UTC, for sentences that go elsewhere: 2026-01-31 04:00 UTC+01:00.

        Short names of zones are of no use there: CST, IST and PST are several zones each."""
        return self.told_at(datetime.fromisoformat(iso))

    def told_at(self, moment: datetime) -> str:
        stamp = self.at(moment).isoformat(" ", "minutes")
        return f"{stamp[:16]} UTC{stamp[16:].removeprefix('+00:00')}"

    @property
    def in_words(self) -> str:
        """What follows "Times are"."""
        return "UTC" if self.name == "UTC" else f"those of {self.name}"

    def instant(self, shown: datetime) -> datetime:
        """What a clock of the plant showed, as an instant; of an hour that came twice it is the first time. What has an
        offset has its own zone."""
        return shown if shown.tzinfo else shown.replace(tzinfo=ZoneInfo(self.name)).astimezone(UTC)


UTC_CLOCK = PlantClock("UTC")


def moment_of(time_ns: int) -> datetime:
    return datetime.fromtimestamp(time_ns / 1e9, UTC)


def seconds_of(iso: str) -> float:
    """Since 1970, UTC."""
    return datetime.fromisoformat(iso).timestamp()


def ns_of(moment: datetime) -> int:
    """Nanoseconds since 1970, UTC, exact; without an offset the moment is UTC. Beyond what the time of a sample can be
    it is the end of that: nothing lies outside of it anyway."""
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return max(-FARTHEST_NS, min(FARTHEST_NS, span_ns(aware - EPOCH)))


def latest_ns(at: datetime | None = None) -> int:
    """Up to when samples are looked at by a clock that shows `at`; None: now."""
    return ns_of((at or datetime.now(UTC)) + AHEAD)


def span_ns(span: timedelta) -> int:
    return span // timedelta(microseconds=1) * 1000
