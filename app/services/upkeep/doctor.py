"""The doctor: looks at an installation piece by piece; each is a row of evidence, with advice where it is unwell."""

import os
import shutil
import sqlite3
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path
from typing import Literal

from sqlalchemy.exc import DatabaseError, SQLAlchemyError

from app.counting import counted
from app.logs import redacted
from app.misspelt_settings import misspelt
from app.services.access import keys
from app.services.access.rates import shared_refusal
from app.services.auditing.standing_still import stands_still_s
from app.services.backend import Backend
from app.services.data_folder import if_lost
from app.services.database_errors import DATABASE_AWAY, no_connection_left, no_room, takes_no_writes
from app.services.digests import deliveries
from app.services.digests.webhooks import forbidden_hosts, is_taken_as_it_is
from app.services.mounts import FSTAB, place_away
from app.services.plant.arrivals import arrivals, sentences
from app.services.telling.naming import one_line
from app.services.upkeep.readiness import LEAST_FREE_BYTES
from app.services.upkeep.retention import oldest_export
from app.settings import Settings
from app.sqlite_files import file_of
from app.storage import figures, health, retention, schema, uploads
from app.storage.database import WAL_SAFE_FROM, parsed

State = Literal["ok", "warning", "problem"]
COMFORTABLE_FREE_BYTES = 5 << 30
LARGEST_CLOCK_DIFFERENCE_S = 2.0
SLOW_DATABASE_S = 0.5
OLD_WORK_S = 6 * 3600
LONGEST_REASON = 400
SOON = timedelta(days=14)
ALL_IN_USE = "all connections are in use: more of them (max_connections, CONNECTION LIMIT of role or database)"
OTHERS = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True)
class Check:
    """`found` is what was seen, `advice` what to do about it (empty where all is well)."""

    name: str
    state: State
    found: str
    advice: str = ""


@dataclass(frozen=True)
class LastCheck(Check):
    """One after which all that follows would fail for the same reason."""


def examine(settings: Settings) -> list[Check]:
    """Every check that can be made; where the database is away, those that need it say so."""
    folder = data_folder(settings)
    checks = [folder, disk(settings), kernel_cache(), openness(settings), variables(), sqlite_version(settings)]
    file = _sqlite_file(settings)
    if file is not None and not _is_begun(file):
        return [*checks, not_set_up(file)]
    if file is not None and folder.state == "problem":
        return checks
    backend = Backend.open(settings, looks_only=True)
    try:
        return [*checks, *_of_the_database(backend), broker(backend), rate_limits(settings)]
    finally:
        backend.close()


def _of_the_database(backend: Backend) -> Iterator[Check]:
    """No further than to what makes all that follows fail."""
    yield (found := reachable(backend))
    if found.state == "problem":
        return
    for name, check in OF_THE_DATABASE:
        yield (found := _guarded(name, check, backend))
        if isinstance(found, LastCheck):
            return


def _sqlite_file(settings: Settings) -> Path | None:
    url = parsed(settings.resolved_database_url)
    return file_of(url) if url.get_backend_name() == "sqlite" else None


def _is_begun(file: Path) -> bool:
    return file.is_file() and file.stat().st_size > 0


def not_set_up(file: Path) -> Check:
    if place := place_away(file):
        found = f"there is no {file}, and {place}, which {FSTAB} names, is not mounted"
        return Check("database", "problem", found, "mount it: `serve` begins no database there meanwhile")
    return Check("database", "warning", f"not set up yet: there is no {file}", "`loopaudit serve` or `migrate` does it")


def data_folder(settings: Settings) -> Check:
    folder = settings.data_dir
    if folder.exists() and not folder.is_dir():
        return Check("data folder", "problem", f"{folder} is no folder", "name another one in LOOPAUDIT_DATA_DIR")
    if not folder.is_dir():
        advice = "`loopaudit serve` or `migrate` makes it, unless it was there: then mount it"
        return Check("data folder", "problem", f"{folder} is not there", advice)
    if _is_read_only(folder):
        advice = "mount it for writing, or name another folder in LOOPAUDIT_DATA_DIR"
        return Check("data folder", "problem", f"{folder} is on a file system that is mounted read-only", advice)
    if not os.access(folder, os.W_OK | os.X_OK):
        return Check(
            "data folder", "problem", f"{folder} cannot be written", f"give it to this user (uid {os.getuid()})"
        )
    open_to = [path for path in (folder, settings.uploads_dir, *_databases(folder)) if _open_to_others(path)]
    if _open_to_others(folder):
        names = ", ".join(str(path) for path in open_to)
        return Check("data folder", "warning", f"others on this machine may read {names}", f"chmod 700 {folder}")
    return Check("data folder", "ok", f"{folder}, for its owner alone")


def disk(settings: Settings) -> Check:
    there = next(path for path in (settings.data_dir, *settings.data_dir.parents) if path.exists())
    free = shutil.disk_usage(there).free
    found = f"{free / (1 << 30):.1f} GiB free at {there}"
    if _is_read_only(there):
        return Check("disk", "problem", f"{there} is mounted read-only", "see the data folder")
    if free < LEAST_FREE_BYTES:
        return Check("disk", "problem", found, "make room: uploads are refused (507) and /readyz says not_ready")
    if free < COMFORTABLE_FREE_BYTES:
        advice = "a night of 14,000 loops needs some 0.3 GiB, and its export (CSV) 0.4 to 2.5; make room in time"
        return Check("disk", "warning", found, advice)
    return Check("disk", "ok", found)


def kernel_cache() -> Check:
    folder = os.environ.get("NUMBA_CACHE_DIR")
    if folder is None:
        advice = "set NUMBA_CACHE_DIR to a folder that can be written: every worker compiles for a minute otherwise"
        return Check("kernel cache", "warning", "no folder that can be written", advice)
    if not Path(folder).is_dir() or not os.access(folder, os.W_OK):
        return Check("kernel cache", "warning", f"{folder} cannot be written", "make it writable, or name another one")
    return Check("kernel cache", "ok", folder)


def openness(settings: Settings) -> Check:
    if settings.allow_open and not settings.require_keys:
        advice = "unset LOOPAUDIT_ALLOW_OPEN unless the network itself keeps others out"
        return Check("settings", "warning", "no key is asked for on any address", advice)
    if settings.allowed_hosts and not settings.require_keys:
        advice = "set LOOPAUDIT_REQUIRE_KEYS=true where a proxy on this machine passes requests of others on"
        return Check("settings", "warning", "other names are answered, and on loopback no key is asked for", advice)
    asked = "everywhere" if settings.require_keys else "everywhere but on loopback"
    return Check("settings", "ok", f"keys are asked for {asked}")


def variables() -> Check:
    found = misspelt(os.environ)
    if found:
        return Check("variables", "warning", "; ".join(found), "correct or unset them: they have no effect")
    return Check("variables", "ok", "each LOOPAUDIT_ variable is known")


def sqlite_version(settings: Settings) -> Check:
    if settings.database_url and not settings.database_url.startswith("sqlite"):
        return Check("SQLite", "ok", "not used")
    found = f"SQLite {sqlite3.sqlite_version}"
    if sqlite3.sqlite_version_info < WAL_SAFE_FROM:
        safe = ".".join(map(str, WAL_SAFE_FROM))
        return Check("SQLite", "ok", f"{found}: journal mode TRUNCATE, because WAL may lose data before {safe}")
    return Check("SQLite", "ok", f"{found}: journal mode WAL")


def reachable(backend: Backend) -> Check:
    try:
        took_s = backend.database.answers()
    except SQLAlchemyError as error:
        advice = _advice(backend, error) or "start it, or correct LOOPAUDIT_DATABASE_URL"
        return Check("database", "problem", f"{_where(backend)} cannot be used: {_reason(error)}", advice)
    found = f"{_where(backend)} answers in {1000 * took_s:.0f} ms"
    if took_s >= SLOW_DATABASE_S:
        return Check("database", "warning", found, "slow")
    return Check("database", "ok", found)


def growth(backend: Backend) -> Check:
    """Whether there is room where the database has its files, which for a server is a disk that is not seen from
    here."""
    name = "growth"
    if backend.database.is_sqlite and not backend.database.takes_writes():
        advice = f"give the file and its folder to this user (uid {os.getuid()}); its address must not say mode=ro"
        return Check(name, "problem", f"{_where(backend)} cannot be written", advice)
    if backend.database.is_sqlite:
        return Check(name, "ok", "the database is on the disk of the data folder")
    try:
        with backend.database.write() as connection:
            health.try_to_grow(connection)
    except DATABASE_AWAY as error:
        if takes_no_writes(error):
            advice = "name the server that takes writes in LOOPAUDIT_DATABASE_URL, or let this one take them again"
            return Check(name, "problem", f"the database is read-only: {_reason(error)}", advice)
        if not no_room(error):
            raise
        advice = "make room on the disk of its server: until then nothing is audited, and exports wait to be read"
        return Check(name, "problem", f"the database has no room: {_reason(error)}", advice)
    except SQLAlchemyError as error:  # as where temporary tables are not allowed
        return Check(name, "ok", f"cannot be tried: {_reason(error)}")
    return Check(name, "ok", f"the database takes {health.PROBED_MB} MB more")


def tables(backend: Backend) -> Check:
    found, newest = schema.current_revision(backend.database), schema.newest_revision()
    if found == newest:
        return Check("tables", "ok", f"version {found}")
    newer = found is not None and not schema.is_known(found)
    advice = "a newer loopaudit made them: run that one" if newer else "run `loopaudit migrate`"
    needed = f"this program needs version {newest}"
    if found is None:
        return LastCheck("tables", "problem", f"there are none, {needed}", advice)
    return Check("tables", "problem", f"version {found}, {needed}", advice)


def journal(backend: Backend) -> Check:
    if not backend.database.is_sqlite:
        return Check("integrity", "ok", "PostgreSQL looks after it")
    with backend.database.read() as connection:
        found = health.integrity(connection)
    mode = f"journal mode {found.journal_mode}"
    if found.damaged is not None:
        told = f"the file is damaged: {found.damaged}"
        return Check("integrity", "problem", told, "restore a backup: `loopaudit restore`")
    if found.unsafe or found.broken:
        return Check("integrity", "problem", f"{mode}, broken reference: {found.broken}", "restore a backup")
    return Check("integrity", "ok", f"{mode}, no broken reference")


def clock(backend: Backend) -> Check:
    with backend.database.read() as connection:
        difference_s = health.clock_difference_s(connection)
    found = f"{difference_s:.1f} s apart from the database's"
    if difference_s > LARGEST_CLOCK_DIFFERENCE_S:
        return Check("clock", "warning", found, "let both keep time by NTP; leases follow the database's clock")
    return Check("clock", "ok", found)


def workers(backend: Backend) -> Check:
    """Alive is who gets on: a worker that hears nothing looks alive to everything but the database."""
    with backend.database.read() as connection:
        found = figures.waiting(connection)
    if silent_s := stands_still_s(backend):
        advice = "start `loopaudit worker` and `loopaudit beat`, or look at their logs"
        return Check(
            "workers",
            "problem",
            f"loops are waiting, and no worker has given a sign of life for {silent_s:.0f} s",
            advice,
        )
    open_, claimed = found.items.get("open", 0), found.items.get("claimed", 0)
    none = "no loop waits; whether a worker runs shows only while loops wait"
    return Check("workers", "ok", f"{counted(claimed, 'loop')} in work, {open_} waiting" if open_ or claimed else none)


def oldest_work(backend: Backend) -> Check:
    with backend.database.read() as connection:
        found = figures.waiting(connection)
    text = f"oldest open run {found.oldest_open_s:.0f} s, oldest unread upload {found.oldest_unread_s:.0f} s"
    if max(found.oldest_open_s, found.oldest_unread_s) > OLD_WORK_S:
        return Check(
            "open work", "warning", text, "more workers, or a look at what fails: GET /v1/audits, GET /v1/uploads"
        )
    return Check("open work", "ok", text)


def room(backend: Backend) -> Check:
    with backend.database.read() as connection:
        count, longest = uploads.waiting_for_room(connection)
    if longest is None or longest.waits_since is None:
        return Check("room", "ok", "no upload waits for room on the disk")
    name = one_line(longest.filename)
    since = backend.clock.told_at(longest.waits_since)
    found = counted(count, "upload waits", "uploads wait")
    found += f" for room on the disk, {longest.id} ({name}, {longest.size_bytes:,} bytes) since {since}"
    advice = "make room; one that waits on although there is room needs more than the disk can give: send it in parts"
    long_ago = datetime.now(UTC) - longest.waits_since > timedelta(seconds=OLD_WORK_S)
    return Check("room", "problem" if long_ago else "warning", found, advice)


def records(backend: Backend) -> Check:
    """A plant whose exports stopped is audited night after night all the same."""
    found = arrivals(backend)
    told = " ".join(sentences(found, backend.clock)) or "nothing was recorded yet"
    if found.late or found.behind:
        return Check("records", "warning", told, "look whether the historian's export runs, and names all loops")
    if found.ahead:
        return Check("records", "warning", told, "look at the time zone and the order of day and month of their files")
    return Check("records", "ok", told)


def keys_of_the_plant(backend: Backend) -> Check:
    active = [key for key in keys.list_keys(backend) if key.state == "active"]
    soon = (datetime.now(UTC) + SOON).isoformat()
    ending = [key.name for key in active if key.expires_at and key.expires_at < soon and not key.followed_by]
    if ending:
        names = ", ".join(ending[:5])
        return Check(
            "keys", "warning", f"{len(active)} good; ending within two weeks: {names}", "`loopaudit keys rotate`"
        )
    if not active and backend.settings.require_keys:
        return Check("keys", "problem", "keys are asked for and there is none", "`loopaudit keys create NAME`")
    return Check("keys", "ok", f"{len(active)} good")


def broker(backend: Backend) -> Check:
    if backend.settings.embedded and not backend.settings.data_dir.is_dir():
        return Check("broker", "problem", "it is in the data folder, which is not there", "see the data folder")
    if backend.queue.reachable():
        return Check("broker", "ok", "answers")
    if refusal := backend.queue.refusal:
        return Check("broker", "problem", f"{refusal.told}: uploads are kept, audits wait", refusal.advice)
    advice = "start it, or correct LOOPAUDIT_BROKER_URL; uploads are kept, and audits wait until then"
    return Check("broker", "problem", "does not answer", advice)


def exports(backend: Backend) -> Check:
    """Rows first, then files: one that is sent meanwhile has its file before its row."""
    with backend.database.read() as connection:
        unread = uploads.unread_fingerprints(connection)
        unseen = set(uploads.unseen(connection).values())
        needed = retention.fingerprints_to_keep(connection, oldest_export(backend.settings))
    try:
        there = {file.name for file in backend.settings.uploads_dir.iterdir()}
    except OSError as error:
        found = f"{backend.settings.uploads_dir} cannot be looked into: {error.strerror}"
        is_there = backend.settings.uploads_dir.exists()
        advice = "see the data folder" if is_there else f"mount it; {if_lost(backend.settings)}"
        return Check("exports", "problem", found, advice)
    advice = "look whether all processes have the same data folder; restore a backup, or send the exports again"
    if lost := unread - there:
        gone = counted(len(lost), "export that is still to be read is", "exports that are still to be read are")
        found = f"{gone} gone, such as {min(lost)[:12]}"
        return Check("exports", "problem", found, advice)
    if unseen:
        found = counted(len(unseen), "export is here and no worker sees it", "exports are here and no worker sees them")
        return Check("exports", "problem", found, "give all processes the same data folder, mounted where each runs")
    if early := needed - there:
        gone = counted(len(early), "export that was read is", "exports that were read are")
        return Check("exports", "warning", f"{gone} gone before {'its' if len(early) == 1 else 'their'} time", advice)
    return Check("exports", "ok", f"{len(needed):,} of {len(needed):,} are there")


def rate_limits(settings: Settings) -> Check:
    if not settings.rate_limit_url:
        return Check("rate limits", "ok", "each API process counts alone")
    advice = (
        "start that Redis, or correct LOOPAUDIT_RATE_LIMIT_URL (its login too); until then each process counts alone"
    )
    try:
        refusal = shared_refusal(settings)
    except ValueError as error:
        return Check("rate limits", "problem", f"LOOPAUDIT_RATE_LIMIT_URL: {error}", "redis://host:port/number")
    if refusal is not None:
        return Check("rate limits", "warning", f"the Redis that counts for all processes {refusal}", advice)
    return Check("rate limits", "ok", "counted together")


def digests(backend: Backend) -> Check:
    receivers = backend.settings.digest_receivers
    if not receivers:
        return Check("digest", "ok", "nobody gets one")
    links = "" if backend.settings.public_url else "; no links, because LOOPAUDIT_PUBLIC_URL is not set"
    good = Check("digest", "ok", f"{counted(len(receivers), 'receiver')}{links}")
    return next(chain(_unsent_digests(backend), _doubtful_digests(backend)), good)


def _unsent_digests(backend: Backend) -> Iterator[Check]:
    """Why receivers get none."""
    settings = backend.settings
    missing = list(deliveries.missing_settings(backend))
    if missing:
        found = f"{counted(len(settings.digest_receivers), 'receiver')}, not set: {', '.join(missing)}"
        yield Check("digest", "problem", found, "set these")
    if forbidden := forbidden_hosts(settings):
        found = f"no webhook goes to {forbidden[0]}, a private or special address"
        yield Check("digest", "problem", found, "LOOPAUDIT_DIGEST_PRIVATE_WEBHOOKS=true allows these")
    failed = deliveries.newest_failed(backend)
    if failed:
        found = f"the newest was given up for {failed[0].receiver}: {failed[0].reason}"
        advice = f"`loopaudit digest --send --audit {failed[0].audit_id}` once the reason is mended"
        yield Check("digest", "warning", found, advice)
    lost = next(deliveries.out_of_reach(backend), None)
    if lost:
        yield Check("digest", "warning", lost, "correct the address, or the name server of this machine")


def _doubtful_digests(backend: Backend) -> Iterator[Check]:
    """What is not as whoever set it may think."""
    settings = backend.settings
    if settings.digest_webhooks and is_taken_as_it_is(settings.digest_webhook_secret.get_secret_value()):
        found = "the webhooks' secret begins with whsec_ and is no padded base64: it signs as plain text, as it stands"
        advice = "where the receiver decodes it, write it with + and / for - and _, and = up to a multiple of four"
        yield Check("digest", "warning", found, advice)
    if settings.digest_smtp_user and not settings.digest_smtp_starttls:
        yield Check(
            "digest", "warning", "the mail server's password travels in clear", "LOOPAUDIT_DIGEST_SMTP_STARTTLS"
        )


OF_THE_DATABASE: tuple[tuple[str, Callable[[Backend], Check]], ...] = (
    ("tables", tables),
    ("integrity", journal),
    ("growth", growth),
    ("clock", clock),
    ("workers", workers),
    ("open work", oldest_work),
    ("room", room),
    ("records", records),
    ("exports", exports),
    ("keys", keys_of_the_plant),
    ("digest", digests),
)


def _guarded(name: str, check: Callable[[Backend], Check], backend: Backend) -> Check:
    try:
        return check(backend)
    except SQLAlchemyError as error:
        # SQLite has one class of errors for a table that is not there and for a file that cannot be read.
        away = isinstance(error, DATABASE_AWAY) and not backend.database.is_sqlite
        usual = "look at the log of the database" if away else "run `loopaudit migrate`"
        return Check(name, "problem", f"cannot be looked at: {_reason(error)}", _advice(backend, error) or usual)


def _advice(backend: Backend, error: SQLAlchemyError) -> str | None:
    """Where the error tells what is wrong."""
    if _is_damaged(backend, error):
        return "restore a backup: `loopaudit restore`"
    if no_connection_left(error):
        return f"{ALL_IN_USE}, or a smaller LOOPAUDIT_POOL_SIZE for each process (now {backend.settings.pool_size})"
    return None


def _is_damaged(backend: Backend, error: SQLAlchemyError) -> bool:
    """Whether SQLite says that its file is none, or is broken: that is no database that is merely away."""
    return backend.database.is_sqlite and type(error) is DatabaseError


def _reason(error: SQLAlchemyError) -> str:
    """In the database's own words, on one line, without the statement that SQLAlchemy adds."""
    words = one_line(str(getattr(error, "orig", None) or error))
    return redacted(words[:LONGEST_REASON]) or type(error).__name__


def _where(backend: Backend) -> str:
    return backend.database.url.render_as_string(hide_password=True)


def _databases(folder: Path) -> Iterator[Path]:
    return folder.glob("*.db")


def _is_read_only(path: Path) -> bool:
    return bool(os.statvfs(path).f_flag & os.ST_RDONLY)


def _open_to_others(path: Path) -> bool:
    return path.exists() and bool(path.stat().st_mode & OTHERS)
