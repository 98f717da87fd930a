"""The tables, for PostgreSQL and SQLite alike. Changed here, a migration goes with it (a test compares the two)."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    ColumnElement,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    bindparam,
    false,
    text,
)

from app.storage.types import UtcDateTime

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

# SQLite numbers rows by itself only in a column of type INTEGER.
Id = BigInteger().with_variant(Integer(), "sqlite")


def _partial(name: str, *columns: str, where: str) -> Index:
    """An index over few of the rows: those that are still to do, or that have what is asked for."""
    return Index(name, *columns, postgresql_where=text(where), sqlite_where=text(where))


def in_words(column: Column[str], *states: str) -> ColumnElement[bool]:
    """Whether a row is in one of these states, which stand in the statement: to SQLite values that are sent beside it
    are not those of a partial index, and it reads the table."""
    if len(states) == 1:  # SQLite finds no index of one state by a list of it
        return column == bindparam(None, states[0], Text(), literal_execute=True, unique=True)
    return column.in_(bindparam(None, states, Text(), expanding=True, literal_execute=True, unique=True))


uploads = Table(
    "uploads",
    metadata,
    Column("id", Id, primary_key=True),
    Column("content_key", Text, nullable=False, unique=True),  # of bytes, name and how to read them
    Column("fingerprint", Text, nullable=False),  # SHA-256 of the content: of the bytes, unpacked where they are gzip
    Column("filename", Text, nullable=False),
    Column("content_type", Text),
    Column("size_bytes", BigInteger, nullable=False),
    Column("reading_json", Text, nullable=False, server_default="{}"),
    Column("received_at", UtcDateTime, nullable=False),
    Column("received_by", Text),
    Column("receipt_number", BigInteger, nullable=False, server_default="0"),  # in the order in which all came
    Column("sent_again_at", UtcDateTime),  # when this content came last, where it came more than once
    Column("state", Text, nullable=False, server_default="received"),
    Column("ended_at", UtcDateTime),
    Column("error_code", Text),
    Column("error_text", Text),
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("owner", Text),
    Column("lease_until_s", Float),
    Column("announced_s", Float),
    Column("pause_s", Float),  # until it is announced again, where it found no room on the disk
    Column("waits_since", UtcDateTime),  # when it first found none; the tries since then did not either
    Column("unseen_since", UtcDateTime),  # when a worker first did not see its file; none did since then
    Column("summary_json", Text),
    Column("tags_json", Text),  # which tag became what: megabytes of a plant's export, read for one upload alone
    CheckConstraint("state IN ('received', 'reading', 'done', 'failed')", name="state"),
    _partial("ix_uploads_unread", "receipt_number", where="state IN ('received', 'reading')"),
    Index("ix_uploads_fingerprint", "fingerprint"),
)

UNREAD = in_words(uploads.c.state, "received", "reading")
"""Of an upload: it is still to be read."""

rejects = Table(
    "rejects",
    metadata,
    Column("upload_id", Id, ForeignKey("uploads.id", ondelete="CASCADE"), primary_key=True),
    Column("number", Integer, primary_key=True),
    Column("line", BigInteger),
    Column("code", Text, nullable=False),
    Column("text", Text, nullable=False),
    Column("tag", Text, nullable=False, server_default=""),
)

kept_tags = Table(
    "kept_tags",
    metadata,
    Column("file", Text, primary_key=True),  # its stem, casefolded, of a tag that names no loop by itself; else empty
    Column("name", Text, primary_key=True),  # the tag, casefolded
    Column("tag", Text, nullable=False),
    Column("loop", Text, nullable=False),
    Column("signal", Text, nullable=False),
    Column("kept_at", UtcDateTime, nullable=False),
    Column("kept_by", Text, nullable=False, server_default=""),
)
"""Where somebody said that a tag belongs, in later files too."""

read_tags = Table(
    "read_tags",
    metadata,
    Column("file", Text, primary_key=True),
    Column("name", Text, primary_key=True),
    Column("loop", Text, nullable=False),
    Column("signal", Text, nullable=False),
    Column("unit", Text, nullable=False, server_default=""),  # as the tag tells it; `name` is without it
    Column("receipt_number", BigInteger, nullable=False),  # of the upload that was the first to have it so
    Column("newest_number", BigInteger, nullable=False, server_default="0"),  # of the last to, while others were unread
)
"""As what each tag was read last; `file` and `name` as above."""

loops = Table(
    "loops",
    metadata,
    Column("id", Id, primary_key=True),
    Column("tag", Text, nullable=False, unique=True),
    Column("unit", Text),
    Column("type", Text),
    Column("description", Text),
    Column("owner", Text),  # who looks after it: a person, a crew, a group
    Column("importance", Float, nullable=False, server_default="1"),
    Column("pv_unit", Text),
    Column("pv_low", Float),
    Column("pv_high", Float),
    Column("op_low", Float),
    Column("op_high", Float),
    Column("integrating", Boolean),
    Column("moves_valve", Boolean),  # and not the set point of another loop; None: found from the records
    Column("retired", Boolean, nullable=False, server_default=false()),  # gone, or never one: kept, and counted nowhere
    Column("continues", Text),  # the tag that it had before: that loop is retired, and its notes are with this one
    Column("created_at", UtcDateTime, nullable=False),
    Column("newest_ns", BigInteger),  # time of the newest sample
    Column("newest_audit_id", Id),  # the run of the newest verdict
)

upload_loops = Table(
    "upload_loops",
    metadata,
    Column("upload_id", Id, ForeignKey("uploads.id", ondelete="CASCADE"), primary_key=True),
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), primary_key=True),
)

series = Table(
    "series",
    metadata,
    Column("id", Id, primary_key=True),
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), nullable=False),
    Column("start_ns", BigInteger, nullable=False),
    Column("end_ns", BigInteger, nullable=False),
    Column("samples", Integer, nullable=False),
    Column("fingerprint", Text, nullable=False),  # of the stretch as it was sent, and which upload sent it again
    Column("upload_id", Id, ForeignKey("uploads.id", ondelete="SET NULL")),
    Column("receipt_number", BigInteger, nullable=False, server_default="0"),  # of that upload, which may be gone
    Column("packed", LargeBinary, nullable=False),
    Column("sp_ns", BigInteger),  # the last known set point of the stretch, and its time
    Column("sp_last", Float),
    Column("mode_ns", BigInteger),
    Column("mode_last", Float),
    UniqueConstraint("loop_id", "fingerprint"),
    _partial("ix_series_upload", "upload_id", where="upload_id IS NOT NULL"),  # an upload that goes is taken out here
    Index("ix_series_loop_end", "loop_id", "end_ns"),
    _partial("ix_series_sp", "loop_id", "sp_ns", where="sp_ns IS NOT NULL"),
    _partial("ix_series_mode", "loop_id", "mode_ns", where="mode_ns IS NOT NULL"),
)

AS_RECEIVED = (series.c.receipt_number, series.c.id)
"""The order of stretches: of two values at one time the last one holds."""

audits = Table(
    "audits",
    metadata,
    Column("id", Id, primary_key=True),
    Column("trigger", Text, nullable=False),
    Column("plant", Text, nullable=False),
    Column("nightly_for", Text),  # the date of a nightly run: one a plant and date
    Column("state", Text, nullable=False, server_default="planned"),
    Column("filter_json", Text, nullable=False, server_default="{}"),
    Column("config_json", Text, nullable=False),
    Column("config_fingerprint", Text, nullable=False),
    Column("window_h", Float, nullable=False),
    Column("window_samples", Integer, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("ended_at", UtcDateTime),
    Column("total", Integer, nullable=False),
    Column("announced_s", Float),  # when a worker last called others to it; below zero: and it is to be announced again
    Column("started_by", Text, nullable=False, server_default=""),
    Column("newest_ns", BigInteger),  # time of the newest sample of the plant then, without those ahead of the clock
    CheckConstraint("state IN ('planned', 'running', 'done', 'partial', 'cancelled')", name="state"),
    UniqueConstraint("plant", "nightly_for"),
    _partial("ix_audits_unfinished", "id", where="state IN ('planned', 'running')"),
)

UNFINISHED = ("planned", "running")
"""States of a run that is still to be worked on."""
GOING_ON = in_words(audits.c.state, *UNFINISHED)
"""Of a run: it is still to be worked on."""

audit_items = Table(
    "audit_items",
    metadata,
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="CASCADE"), primary_key=True),
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), primary_key=True),
    Column("state", Text, nullable=False, server_default="open"),
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("owner", Text),
    Column("lease_until_s", Float),
    Column("code", Text),
    Column("text", Text),
    CheckConstraint("state IN ('open', 'claimed', 'done', 'failed')", name="state"),
    _partial("ix_audit_items_open", "audit_id", "attempts", "loop_id", where="state = 'open'"),
    _partial("ix_audit_items_claimed", "lease_until_s", where="state = 'claimed'"),
    _partial("ix_audit_items_failed", "audit_id", "loop_id", where="state = 'failed'"),
)

verdicts = Table(
    "verdicts",
    metadata,
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), primary_key=True),
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="CASCADE"), primary_key=True),
    Column("audited_at", UtcDateTime, nullable=False),
    Column("window_start", UtcDateTime),
    Column("window_end", UtcDateTime),
    Column("input_start_ns", BigInteger),  # what was given to the engine: enough to make the verdict again
    Column("input_end_ns", BigInteger),
    Column("samples", Integer, nullable=False),
    Column("sampling_interval_s", Float),
    Column("verdict", Text, nullable=False),
    Column("stiction_probability", Float),
    Column("reliability", Text, nullable=False),
    Column("yper_pct", Float),
    Column("yper_raw_pct", Float),
    Column("table2_reading", Text),
    Column("stiction_band_pct_of_op_range", Float),
    Column("likely_cause", Text),
    Column("engine_version", Text, nullable=False),
    Column("elapsed_s", Float, nullable=False),
    Column("oscillation_period_s", Float),
    Column("oscillation_regularity", Float),
    Column("filled_share", Float),
    Column("input_fingerprint", Text, nullable=False),
    Column("config_fingerprint", Text, nullable=False),
    Column("reasons", Text, nullable=False),
    Column("reasons_text", Text, nullable=False),
    Column("hammerstein_d", Float),
    Column("hammerstein_S", Float),
    Column("hammerstein_J", Float),
    Column("hammerstein_na", Integer),
    Column("hammerstein_nb", Integer),
    Column("hammerstein_nc", Integer),
    Column("hammerstein_rmse", Float),
    Column("hammerstein_rmse_without_stiction", Float),
    Column("hammerstein_search_space", Text),
    Column("hammerstein_widenings", Integer),
    Column("oscillation_strength", Float),
    Column("health", Float),
    Column("health_parts", Text),
    Column("moves_set_point_of", Text),
    Column("set_point_moved_by", Text),
    Column("extra_json", Text, nullable=False, server_default="{}"),  # fields of a row without a column of their own
    Index("ix_verdicts_audit", "audit_id"),
)

verdict_details = Table(
    "verdict_details",
    metadata,
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), primary_key=True),
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="CASCADE"), primary_key=True),
    Column("packed", LargeBinary, nullable=False),
    Index("ix_verdict_details_audit", "audit_id"),
)

newest_rows = Table(
    "newest_rows",
    metadata,
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), primary_key=True),
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="CASCADE"), nullable=False),
    Column("form", Text, nullable=False),  # which fields the row has, and how they are written
    Column("swing_json", Text),  # what is kept of an oscillation, to compare loops by
    Column("excerpts_json", Text),  # and of OP and SP
    Column("row_json", Text, nullable=False),  # a row of the reliability table without what its loop says of itself
    Column("figures_json", Text, nullable=False, server_default="{}"),  # the key figures
    Column("verdict", Text),  # of the verdict, what is filtered and sorted by most
    Column("reliability", Text),
    Column("likely_cause", Text),
    Column("table2_reading", Text),
    Column("stiction_probability", Float),
    Column("health", Float),
    Column("before_audit_id", Id),  # of the verdict that this one took the place of; its run may be gone
    Column("verdict_before", Text),
    Column("audited_at", UtcDateTime),  # of the verdict, as the two after it: which record it is of
    Column("window_end", UtcDateTime),
    Column("input_end_ns", BigInteger),
    # What the pages ask of all loops is read from here: 2 MB, not the hundred of rows with their texts.
    Index(
        "ix_newest_rows_board",
        *("loop_id", "audit_id", "verdict", "reliability", "likely_cause", "stiction_probability", "health"),
        *("verdict_before", "before_audit_id", "audited_at", "window_end", "input_end_ns"),
    ),
)

explanations = Table(
    "explanations",
    metadata,
    Column("id", Id, primary_key=True),
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), nullable=False),
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="SET NULL")),  # of the nightly run that asked for it
    Column("state", Text, nullable=False, server_default="open"),
    Column("asked_at", UtcDateTime, nullable=False),
    Column("asked_by", Text),
    Column("ended_at", UtcDateTime),
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("owner", Text),
    Column("lease_until_s", Float),
    Column("announced_s", Float),
    Column("pause_s", Float),  # where the disk was full: until it is tried again, from `announced_s` on
    Column("waits_since", UtcDateTime),  # since when it finds no room
    Column("window_start_ns", BigInteger),  # the stretch of the recording that is explained
    Column("window_end_ns", BigInteger),
    Column("as_judged", Boolean, nullable=False, server_default=false()),  # of it only what an audit judges
    Column("simulation_packed", LargeBinary),  # what was given: a trace or a model; None: our own linear loop
    Column("verdict", Text),
    Column("effects", Text, nullable=False, server_default=""),  # codes, the strongest first, for lists
    Column("error_code", Text),
    Column("error_text", Text),
    Column("packed", LargeBinary),  # the whole answer and its traces
    CheckConstraint("state IN ('open', 'claimed', 'done', 'failed')", name="state"),
    Index("ix_explanations_loop", "loop_id", "id"),
    UniqueConstraint("loop_id", "audit_id"),
    _partial("ix_explanations_unfinished", "id", where="state IN ('open', 'claimed')"),
)

UNEXPLAINED = in_words(explanations.c.state, "open", "claimed")
"""Of an explanation: it has not ended."""

keys = Table(
    "keys",
    metadata,
    Column("id", Id, primary_key=True),
    Column("public_id", Text, nullable=False, unique=True),  # the part of the key that finds it
    Column("secret_hash", Text, nullable=False),
    Column("name", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("requests_per_minute", Integer, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("expires_at", UtcDateTime),
    Column("revoked_at", UtcDateTime),
    Column("last_used_at", UtcDateTime),
    Column("followed_by", Text),  # the public_id of the key that it was rotated for
    CheckConstraint("role IN ('read', 'upload', 'audit', 'admin')", name="role"),
)

sessions = Table(
    "sessions",
    metadata,
    Column("token_hash", Text, primary_key=True),
    Column("key_id", Id, ForeignKey("keys.id", ondelete="CASCADE"), nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("expires_at", UtcDateTime, nullable=False),
    Index("ix_sessions_expiry", "expires_at"),
)

trail = Table(
    "trail",
    metadata,
    Column("id", Id, primary_key=True),
    Column("at", UtcDateTime, nullable=False),
    Column("who", Text, nullable=False),  # the key's name, "command line", "schedule"
    Column("key_id", Id),  # no foreign key: the trail outlives keys
    Column("action", Text, nullable=False),
    Column("subject", Text, nullable=False, server_default=""),
    Column("outcome", Text, nullable=False),
    Column("request_id", Text),
    Column("detail_json", Text, nullable=False, server_default="{}"),
    CheckConstraint("outcome IN ('done', 'refused', 'failed', 'not_known')", name="outcome"),
    Index("ix_trail_at", "at"),
)

tallies = Table(
    "tallies",
    metadata,
    Column("name", Text, primary_key=True),
    Column("dropped", BigInteger, nullable=False),  # of rows that are gone: what was counted stays counted
)

numbers = Table(
    "numbers",
    metadata,
    Column("name", Text, primary_key=True),
    Column("last", BigInteger, nullable=False),  # the last one that was given: what had it may be gone
)

notes = Table(
    "notes",
    metadata,
    Column("id", Id, primary_key=True),
    Column("loop_id", Id, ForeignKey("loops.id", ondelete="CASCADE"), nullable=False),
    Column("written_at", UtcDateTime, nullable=False),
    Column("written_by", Text, nullable=False, server_default=""),
    Column("text", Text, nullable=False, server_default=""),
    Column("work_order", Text, nullable=False, server_default=""),
    Column("repaired_at", UtcDateTime),  # verdicts before and after it are compared
    Column("shelved_until", UtcDateTime),  # until then its loop leads no list of what to look at first
    Column("shelved_as", Text),  # what was wrong with the loop then, so that it is seen when something worse is
    Column("withdrawn_at", UtcDateTime),  # since when the repair, or the shelving, does not count
    Column("withdrawn_by", Text, nullable=False, server_default=""),
    Column("written_of", Text),  # under which tag, where its loop has another one by now
    Index("ix_notes_loop", "loop_id", "id"),
)

deliveries = Table(
    "deliveries",
    metadata,
    Column("audit_id", Id, ForeignKey("audits.id", ondelete="CASCADE"), primary_key=True),
    Column("receiver", Text, primary_key=True),  # an address: mailto:..., https://...
    Column("state", Text, nullable=False, server_default="open"),
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("owner", Text),
    Column("lease_until_s", Float),
    Column("next_try_s", Float),
    Column("ended_at", UtcDateTime),
    Column("error_text", Text),
    Column("id_suffix", Text),  # of what is sent once more: part of its id from then on
    CheckConstraint("state IN ('open', 'claimed', 'done', 'failed')", name="state"),
    _partial("ix_deliveries_unfinished", "next_try_s", where="state IN ('open', 'claimed')"),
)

UNDELIVERED = in_words(deliveries.c.state, "open", "claimed")
"""Of a digest to one receiver: it is still to be sent."""
