"""What an error of the database means: that it is away, full, read-only, or has no connection left."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as NoFreeConnection

from app.errors import RequestError
from app.storage.database import READ_ONLY, CommitLostError

DATABASE_AWAY = (OperationalError, InterfaceError, NoFreeConnection)
"""What every service raises where the database does not answer or ends the statement."""


@contextmanager
def away_in_words(*errors: type[Exception]) -> Iterator[None]:
    """Where the database is away, or one of `errors` is raised, RequestError("database_away") says so to who called a
    command."""
    away: tuple[type[Exception], ...] = (*DATABASE_AWAY, *errors)
    try:
        yield
    except away as error:
        text = f"the database cannot be used: {getattr(error, 'orig', None) or error}"
        raise RequestError("database_away", text) from error


def commit_lost(error: Exception) -> bool:
    """Whether it is not known if what was written stands."""
    return isinstance(error, CommitLostError)


DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
DATABASE_FULL = ("disk is full", "No space left")
FULL_IN_SQL = "53100"
"""PostgreSQL tells it in the language of its server, beside this code."""


def no_room(error: Exception) -> bool:
    """Whether a disk is full: that of the exports, or that of the database, which says so in its own words."""
    if isinstance(error, OSError):
        return error.errno in DISK_FULL
    told = _told_by_driver(error)
    return getattr(told, "sqlstate", None) == FULL_IN_SQL or any(words in str(told) for words in DATABASE_FULL)


def takes_no_writes(error: Exception) -> bool:
    """Whether the database answers and is read-only, as a standby is, or a file that was mounted so."""
    told = _told_by_driver(error)
    sqlite = str(getattr(told, "sqlite_errorname", ""))
    return getattr(told, "sqlstate", None) == READ_ONLY or sqlite.startswith("SQLITE_READONLY")


NO_CONNECTION_LEFT = (
    *("too many connections", "too many clients", "connection slots are reserved"),
    "no more connections allowed",  # PgBouncer
    *("zu viele Verbindungen", "verbleibenden Verbindungen"),
    *("trop de connexions", "trop de clients", "emplacements de connexions restants"),
    *("demasiadas conexiones", "demasiados clientes", "conexiones restantes"),
    *("troppe connessioni", "troppi client", "rimanenti slot di connessione"),
    *("för många uppkopplingar", "för många klienter", "resterande anslutningsslottar"),
    *("слишком много подключений", "слишком много клиентов", "оставшиеся слоты подключений"),
    *("занадто багато підключень", "забагато клієнтів", "слоти підключень"),
    *("接続が多すぎます", "クライアント数が多すぎます", "残りの接続スロット"),
    *("동시 접속수를 초과", "동시 접속자 수를 초과", "최대 접속수를 초과", "남은 연결 슬롯"),
    *("მეტისმეტად ბევრი", "ძალიან ბევრი კავშირი"),
    *("连接过多", "剩余连接槽位", "連線太多", "客戶端過多", "剩餘的連線槽"),
)
"""A server refuses a connection in its own language, and the driver drops the code that comes with it."""


def no_connection_left(error: Exception) -> bool:
    """Whether the database answers and lets nobody else in: the server, or the role, has all connections in use."""
    return any(words in str(_told_by_driver(error)) for words in NO_CONNECTION_LEFT)


def _told_by_driver(error: Exception) -> object:
    """What the driver said of a database that is away; the whole text has the statement's parameters in it."""
    return getattr(error, "orig", None) if isinstance(error, DATABASE_AWAY) else None
