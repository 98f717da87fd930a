"""What both databases must mean the same by: instants, the database's own clock, and texts."""

from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import BigInteger, ColumnElement, DateTime, Float, case, or_
from sqlalchemy.engine import Dialect
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.expression import FunctionElement
from sqlalchemy.types import TypeDecorator

CLOCK_ROOM_S = 5.0
"""A clock that is set right by less than this counts as the same clock."""


class UtcDateTime(TypeDecorator[datetime]):
    """An instant; SQLite keeps no zone, so UTC goes in and comes out."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError("a time without a zone cannot be stored")
        moment = value.astimezone(UTC)
        return moment.replace(tzinfo=None) if dialect.name == "sqlite" else moment

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


def storable(text: str) -> str:
    """As both databases keep it: PostgreSQL refuses a zero byte, and neither takes half of a letter."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}").encode("utf-8", "replace").decode("utf-8")


class clock_s(FunctionElement[float]):
    """Seconds since 1970 by the database's own clock, so that leases do not depend on the clocks of workers."""

    type = Float()
    inherit_cache = True


@compiles(clock_s, "postgresql")
def _postgresql_clock(element: clock_s, compiler: Any, **options: Any) -> str:
    return "extract(epoch FROM clock_timestamp())::double precision"


@compiles(clock_s, "sqlite")
def _sqlite_clock(element: clock_s, compiler: Any, **options: Any) -> str:
    return "((julianday('now') - 2440587.5) * 86400.0)"


class whole_ms(FunctionElement[datetime]):
    """An instant as it is told, what is below a millisecond cut."""

    type = UtcDateTime()
    inherit_cache = True


@compiles(whole_ms, "postgresql")
def _postgresql_whole_ms(element: whole_ms, compiler: Any, **options: Any) -> str:
    return f"date_trunc('milliseconds', {compiler.process(element.clauses, **options)})"


@compiles(whole_ms, "sqlite")
def _sqlite_whole_ms(element: whole_ms, compiler: Any, **options: Any) -> str:
    # Kept as text, which sorts as the instants do: 2026-01-31 03:00:00.250000.
    return f"substr({compiler.process(element.clauses, **options)}, 1, 23)"


class whole_ms_ns(FunctionElement[int]):
    """The same in nanoseconds since 1970, as samples have their times."""

    type = BigInteger()
    inherit_cache = True


@compiles(whole_ms_ns, "postgresql")
def _postgresql_whole_ms_ns(element: whole_ms_ns, compiler: Any, **options: Any) -> str:
    moment = compiler.process(element.clauses, **options)
    return f"((extract(epoch FROM date_trunc('milliseconds', {moment})) * 1000)::bigint * 1000000)"


@compiles(whole_ms_ns, "sqlite")
def _sqlite_whole_ms_ns(element: whole_ms_ns, compiler: Any, **options: Any) -> str:
    # SQLite rounds what is below a second, so that it is told apart from it.
    text, again = (compiler.process(element.clauses, **options) for _ in range(2))
    seconds = f"CAST(strftime('%s', substr({text}, 1, 19)) AS INTEGER)"
    return f"(({seconds} * 1000 + CAST(substr({again}, 21, 3) AS INTEGER)) * 1000000)"


def run_out(until_s: ColumnElement[float], longest_s: ColumnElement[float] | float) -> ColumnElement[bool]:
    """Whether a lease or a wait of at most `longest_s` seconds has ended. One that ends later than it could was given
    before the clock of the database was put back: it would outlast its worker, or its reason, by as much."""
    return or_(until_s < clock_s(), until_s > clock_s() + longest_s + CLOCK_ROOM_S)


def long_ago(at_s: ColumnElement[float], seconds: ColumnElement[float] | float) -> ColumnElement[bool]:
    """Whether it was never, or more than `seconds` ago, or ahead of the clock, which then was put back."""
    return or_(at_s.is_(None), at_s < clock_s() - seconds, at_s > clock_s() + CLOCK_ROOM_S)


LONGEST_PAUSE_S = 300.0


def longer_pause(before_s: ColumnElement[float], first_s: float) -> ColumnElement[float]:
    """The pause after this one (NULL: none yet), twice as long, up to some minutes."""
    doubled = (before_s < LONGEST_PAUSE_S / 2, 2 * before_s)
    return case((before_s.is_(None), first_s), doubled, else_=LONGEST_PAUSE_S)


CLOCK_APART = timedelta(hours=1)
"""What is dated further ahead than this was dated by a clock that was wrong."""


def now() -> datetime:
    return datetime.now(UTC)
