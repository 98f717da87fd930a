"""Every setting of the service: an environment variable LOOPAUDIT_<NAME> each, with what it means."""

import ipaddress
import re
from datetime import time
from functools import cache
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit
from zoneinfo import available_timezones

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict

from app.broker_addresses import BROKERS, UNREAD_BROKER, is_read_by_kombu, wrong_option
from app.folders import sync_folder

TASK_LIMIT_S = 600
"""A task of the engine is ended after this time, with its process: its own limits must come first."""
TASK_ROOM_S = 40
"""Of it, for what is read and written around the engine."""
PARTS_OF_EXPLAINING = 2
"""Each of which has the time limit of an explanation."""

PREFIX = "LOOPAUDIT_"


@cache
def _zones_of_everybody() -> frozenset[str]:
    """IANA names. Browsers draw charts by them: what this machine calls localtime is none of theirs. To list them reads
    some hundreds of files."""
    return frozenset(available_timezones() - {"localtime"})


HOST_NAME = re.compile(r"[a-z0-9_]([a-z0-9_.-]*[a-z0-9_])?", re.IGNORECASE | re.ASCII)
LONGEST_LABEL = 63
IN_BASE64 = "whsec_"


def _listed(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _is_host(text: str) -> bool:
    try:
        return bool(ipaddress.ip_address(text))
    except ValueError:
        return HOST_NAME.fullmatch(text) is not None and _can_be_looked_up(text)


def _can_be_looked_up(host: str) -> bool:
    """Whether there are 1 to 63 characters between the dots; one may end it."""
    return all(0 < len(label) <= LONGEST_LABEL for label in host.removesuffix(".").split("."))


class Settings(BaseSettings):
    """Read once at start; `Settings()` takes the environment, arguments override it."""

    model_config = SettingsConfigDict(env_prefix=PREFIX, frozen=True, extra="ignore", hide_input_in_errors=True)

    data_dir: Path = Field(
        Path(".loopaudit"), description="Folder of the uploads, the default database and the default broker."
    )
    database_url: str = Field("", description="SQLAlchemy address of the database; empty: SQLite in the data folder.")
    broker_url: str = Field(
        "",
        description="Address of Celery's broker (redis://, rediss://, amqp://, amqps://); run `loopaudit worker` "
        "and `beat` with it. Empty: a folder in the data folder, and `serve` runs both itself.",
    )
    plant: str = Field(
        "plant", description="Name of the plant. There is one nightly audit per plant and date.", max_length=100
    )
    nightly_at: time = Field(time(2, 0), description="When the nightly audit starts, HH:MM.")
    time_zone: str = Field(
        "UTC",
        description="IANA time zone of NIGHTLY_AT, of times on pages, in digests and in reports, and of time "
        "stamps in exports that name no zone.",
    )
    date_order: Literal["auto", "day", "month"] = Field(
        "auto",
        description="Whether the day or the month comes first in dates such as 03/04/2026, if an export leaves it "
        "open.",
    )
    require_keys: bool = Field(
        False, description="Ask for keys on loopback too. On other addresses they are always asked for."
    )
    allow_open: bool = Field(False, description="Listen on addresses other than loopback without keys.")
    allowed_hosts: str = Field(
        "",
        description="Host names under which the service may be called, separated by commas; empty: see "
        "docs/SECURITY.md.",
    )
    session_h: float = Field(12.0, gt=0, le=720, description="Longest duration of a login, in hours; 720 at most.")
    session_idle_min: float = Field(
        120.0,
        ge=10,
        le=43_200,
        description="A login that is not used for this long ends early, in minutes; 10 at least.",
    )
    key_recheck_s: float = Field(
        5.0,
        ge=0,
        le=300,
        description="How long a key that was valid is accepted without being checked again, in seconds: a "
        "revocation takes effect within this time; 300 at most.",
    )
    rate_limit_url: str = Field(
        "",
        description="redis://... so that several API processes count a key's requests together; empty: each "
        "process counts its own.",
    )

    log_format: Literal["auto", "json", "text"] = Field(
        "auto",
        description="Format of the log on stderr: json, text; auto: text on a terminal, json elsewhere. With "
        "json, each line that serve, worker, beat, nightly, digest, migrate and backup write to "
        "stderr is an object.",
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        "info", description="Lowest level of messages that are logged."
    )

    window_h: float = Field(
        168.0, gt=0, description="An audit uses at most this many hours of a loop's newest samples."
    )
    window_samples: int = Field(
        30_000, ge=100, description="An audit uses at most this many of a loop's newest samples; 100 at least."
    )
    hold_days: float = Field(
        35.0,
        ge=0,
        description="A set point or mode recorded before the window of an audit remains valid for at most this "
        "many days. An explanation of older data disputes a verdict for the same time.",
    )
    chunk_loops: int = Field(32, ge=1, le=1000, description="Loops that a worker claims at a time; 1000 at most.")
    chunk_budget_s: float = Field(
        10.0,
        gt=0,
        description="A task starts loops for this long, in seconds, and then returns the rest of its claim; with "
        "LOOPAUDIT_LOOP_LIMIT_S at most 560.",
    )
    fan_out: int = Field(32, ge=1, description="Largest number of messages sent at a time to wake workers for a run.")
    loop_limit_s: float = Field(
        20.0,
        gt=0,
        description="Time limit of one loop's audit, in seconds; at most half of LOOPAUDIT_LEASE_S, and with "
        "LOOPAUDIT_CHUNK_BUDGET_S at most 560.",
    )
    explanation_samples: int = Field(
        20_000, ge=100, description="An explanation uses at most this many samples of a loop; 100 at least."
    )
    explanation_limit_s: float = Field(
        180.0,
        gt=0,
        le=(TASK_LIMIT_S - TASK_ROOM_S) / PARTS_OF_EXPLAINING,
        description="Time limit of each of the two parts of an explanation, in seconds; 280 at most.",
    )
    nightly_explanations: int = Field(
        5, ge=0, le=1000, description="How many of a night's worst loops are explained; 0: none; 1000 at most."
    )
    lease_s: float = Field(
        40.0,
        gt=0,
        description="A claim that is not renewed within this time, in seconds, goes to another worker; at least "
        "twice LOOPAUDIT_LOOP_LIMIT_S.",
    )
    max_attempts: int = Field(3, ge=1, description="How often a loop that crashes its worker is tried.")
    max_reading_attempts: int = Field(10, ge=1, description="How often an upload that crashes its worker is tried.")
    sweep_s: float = Field(
        5.0, gt=0, description="Interval between searches for lost messages and dead workers, in seconds."
    )
    stalled_s: float = Field(
        20.0, gt=0, description="Open work that nobody claims within this time, in seconds, is announced again."
    )

    keep_series_days: int = Field(
        400,
        ge=0,
        description="Samples are deleted once they are this many days older than the newest sample of their loop; "
        "samples without a date, this many days after they arrived; 0: never.",
    )
    keep_details_days: int = Field(
        90, ge=0, description="Days for which the details of a verdict (its curves) are kept; 0: for ever."
    )
    keep_verdicts_days: int = Field(
        1825,
        ge=0,
        description="Days for which verdicts and runs are kept; a loop's newest verdict is always kept; 0: for ever.",
    )
    keep_explanations_days: int = Field(365, ge=0, description="Days for which explanations are kept; 0: for ever.")
    keep_uploads_days: int = Field(
        30,
        ge=0,
        description="Days for which the original export files are kept after they were last sent; 0: for ever.",
    )
    keep_receipts_days: int = Field(
        730,
        ge=0,
        description="Days for which the record of an upload (its loops, tags and refused rows) is kept after it "
        "was read or last sent, and in any case as long as its export; 0: for ever.",
    )
    keep_trail_days: int = Field(
        730, ge=0, description="Days for which the trail of who did what is kept; 0: for ever."
    )

    public_url: str = Field(
        "", description="Address under which people reach the pages, for links in digests and reports; empty: no links."
    )
    digest_mail_to: str = Field("", description="Addresses that get the nightly digest by mail, separated by commas.")
    digest_webhooks: str = Field(
        "", description="Addresses to which the nightly digest is posted, separated by commas."
    )
    digest_webhook_secret: SecretStr = Field(
        SecretStr(""), description="Secret with which webhooks are signed (HMAC-SHA256); needed for webhooks."
    )
    digest_private_webhooks: bool = Field(
        False, description="Allow webhooks to private and loopback addresses, as in a closed network."
    )
    digest_smtp_host: str = Field("", description="Mail server of the digest; needed for mail.")
    digest_smtp_port: int = Field(587, ge=1, le=65535, description="Port of the mail server.")
    digest_smtp_user: str = Field("", description="User name at the mail server; empty: no login.")
    digest_smtp_password: SecretStr = Field(SecretStr(""), description="Password at the mail server.")
    digest_smtp_starttls: bool = Field(
        True,
        description="Encrypt the connection to the mail server with STARTTLS; false: no encryption. TLS from the "
        "start (port 465) is not supported.",
    )
    digest_mail_from: str = Field("", description="Sender address of the digest; needed for mail.")
    digest_attempts: int = Field(
        8,
        ge=1,
        le=20,
        description="How often sending a digest is tried, at growing intervals, before it is given up; 20 at most.",
    )

    max_upload_bytes: int = Field(4 << 30, ge=1, description="Largest upload, in bytes as sent.")
    upload_deadline_s: float = Field(
        3600.0, gt=0, description="An upload must have arrived within this time, in seconds."
    )
    idle_timeout_s: float = Field(
        30.0,
        gt=0,
        description="A request is refused if its sender pauses for longer than this in the middle of the body, in "
        "seconds.",
    )
    max_requests: int = Field(200, ge=1, description="Requests that an API process answers at the same time.")
    max_uploads: int = Field(64, ge=1, description="Uploads that an API process receives at the same time.")
    max_streams: int = Field(200, ge=1, description="Event streams that an API process serves at the same time.")
    max_rejects: int = Field(
        1000, ge=0, description="Refused rows that are listed for an upload. All of them are counted."
    )
    buffered_samples: int = Field(
        6_000_000,
        ge=1000,
        description="Values that are held in memory while an upload is read, before they are moved to disk, 1000 "
        "at least; a row of one value counts as three. A single loop may have more.",
    )
    statement_timeout_s: float = Field(
        15.0, gt=0, description="Time limit of an SQL statement of the API on PostgreSQL, in seconds."
    )
    worker_statement_timeout_s: float = Field(
        600.0, gt=0, description="Time limit of an SQL statement of a worker on PostgreSQL, in seconds."
    )
    pool_size: int = Field(
        5,
        ge=1,
        description="Connections to PostgreSQL that each of a process's two pools (for reading and for writing) "
        "keeps open. Each pool opens as many again when these are not enough, so a process has at "
        "most four times as many.",
    )
    worker_memory_mb: int = Field(
        400,
        ge=100,
        description="A worker process that has grown beyond this size, in MB, is replaced between tasks; 100 at least.",
    )
    worker_nice: int = Field(
        10,
        ge=0,
        le=19,
        description="Niceness of workers (0 to 19): by how much they yield the processor to the API and the database.",
    )
    worker_tasks: int = Field(500, ge=1, description="A worker process is replaced after this many tasks.")

    @field_validator("nightly_at", mode="before")
    @classmethod
    def _hour_and_minute(cls, told: object) -> object:
        """2:00 too, which people write."""
        if not isinstance(told, str):
            return told
        found = re.fullmatch(r"([01]?\d|2[0-3]):([0-5]\d)(:00)?", told.strip(), re.ASCII)
        if found is None:
            raise ValueError(f"HH:MM is needed, such as 02:00; got {told[:20]!r}")
        return time(int(found[1]), int(found[2]))

    @field_validator("plant")
    @classmethod
    def _named(cls, name: str) -> str:
        if not name.strip():
            raise ValueError("a name is needed; without the variable it is 'plant'")
        return name

    @field_validator("time_zone")
    @classmethod
    def _known_zone(cls, name: str) -> str:
        if name not in _zones_of_everybody():
            raise ValueError(f"{name!r} is no time zone; an IANA name is needed, such as Europe/Berlin")
        return name

    @field_validator("data_dir")
    @classmethod
    def _absolute(cls, path: Path) -> Path:
        return path.expanduser().absolute()

    @field_validator("broker_url")
    @classmethod
    def _known_broker(cls, address: str) -> str:
        # Celery takes what it does not know for a host of RabbitMQ, and tries to reach it for ever. What follows the
        # first colon may hold a password: it is not repeated.
        if address and not address.startswith(BROKERS):
            raise ValueError(f"BROKER_URL must begin with {', '.join(BROKERS)}; got {address.partition(':')[0][:20]!r}")
        servers = [] if address.startswith("folder://") else address.split(";")
        if not all(is_read_by_kombu(it) for it in servers):
            raise ValueError("BROKER_URL cannot be read: " + UNREAD_BROKER)
        if wrong := next(filter(None, map(wrong_option, servers)), ""):
            raise ValueError("BROKER_URL" + wrong)
        return address

    @field_validator("public_url")
    @classmethod
    def _address_of_pages(cls, address: str) -> str:
        if address and not address.startswith(("http://", "https://")):
            raise ValueError("PUBLIC_URL must begin with http:// or https://")
        return address.rstrip("/")

    @field_validator("allowed_hosts")
    @classmethod
    def _names_alone(cls, names: str) -> str:
        wrong = [name for name in _listed(names) if not _is_host(name)]
        if wrong:
            text = f"ALLOWED_HOSTS are names alone, without http://, port or path; got {wrong[0][:80]!r}"
            raise ValueError(text + " (an address of IPv6 without brackets)" * ("[" in wrong[0]))
        return names

    @field_validator("digest_smtp_host")
    @classmethod
    def _name_of_a_server(cls, host: str) -> str:
        # The dot that ends a whole name stands in no certificate.
        name = host.removesuffix(".")
        # An address typed whole may hold a password: it is not repeated.
        if host and not _is_host(name):
            lacks = "" if _can_be_looked_up(host) else f", 1 to {LONGEST_LABEL} characters between its dots"
            raise ValueError(f"DIGEST_SMTP_HOST is a name alone{lacks}; its port is DIGEST_SMTP_PORT")
        return name

    @field_validator("digest_webhook_secret")
    @classmethod
    def _secret_that_is_one(cls, secret: SecretStr) -> SecretStr:
        if secret.get_secret_value() == IN_BASE64:
            raise ValueError(f"DIGEST_WEBHOOK_SECRET is {IN_BASE64} alone: what follows it is the secret")
        return secret

    @field_validator("digest_webhooks")
    @classmethod
    def _webhook_addresses(cls, addresses: str) -> str:
        # The addresses themselves may hold secrets: they are not repeated.
        if not all(address.startswith(("http://", "https://")) for address in _listed(addresses)):
            raise ValueError("each of DIGEST_WEBHOOKS must begin with http:// or https://")
        for place, address in enumerate(_listed(addresses), 1):
            try:
                parts = urlsplit(address)
                whole = parts.port != 0 and _can_be_looked_up(parts.hostname or "")
            except ValueError:
                whole = False
            if not whole:
                raise ValueError(
                    f"number {place} of DIGEST_WEBHOOKS is no address: it lacks a host of 1 to {LONGEST_LABEL} "
                    "characters between its dots, or its port is none"
                )
        return addresses

    @field_validator("digest_mail_to", "digest_mail_from")
    @classmethod
    def _mail_addresses(cls, addresses: str) -> str:
        wrong = [address for address in _listed(addresses) if not re.fullmatch(r"[!-~]+@[!-~]+", address)]
        if wrong:
            raise ValueError(f"not an address of mail: {wrong[0][:80]!r}")
        return addresses

    @model_validator(mode="after")
    def _lease_outlasts_a_loop(self) -> "Settings":
        if self.lease_s < 2 * self.loop_limit_s:
            needed = "LOOPAUDIT_LEASE_S must be at least twice LOOPAUDIT_LOOP_LIMIT_S"
            raise ValueError(f"{needed}, got {self.lease_s} and {self.loop_limit_s}")
        return self

    @model_validator(mode="after")
    def _a_loop_ends_before_its_task(self) -> "Settings":
        # The last loop may be begun when the budget is all but over.
        most = TASK_LIMIT_S - TASK_ROOM_S
        if self.chunk_budget_s + self.loop_limit_s > most:
            needed = f"LOOPAUDIT_CHUNK_BUDGET_S and LOOPAUDIT_LOOP_LIMIT_S must be at most {most} together"
            raise ValueError(f"{needed}, got {self.chunk_budget_s} and {self.loop_limit_s}")
        return self

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """No file: to look for each setting in files that nobody named was a third of reading them."""
        return init_settings, env_settings

    @property
    def resolved_database_url(self) -> str:
        return self.database_url or f"sqlite:///{self.data_dir / 'loopaudit.db'}"

    @property
    def resolved_broker_url(self) -> str:
        return self.broker_url or f"folder://{self.data_dir / 'broker'}"

    @property
    def allowed_host_names(self) -> frozenset[str]:
        return frozenset(name.lower() for name in _listed(self.allowed_hosts))

    @property
    def digest_receivers(self) -> tuple[str, ...]:
        """Addresses of receivers: mailto:..., http(s)://..."""
        mails = (f"mailto:{address}" for address in _listed(self.digest_mail_to))
        return tuple(dict.fromkeys((*mails, *_listed(self.digest_webhooks))))

    @property
    def embedded(self) -> bool:
        """Whether `serve` runs worker and schedule itself: no server was named for the broker."""
        return not self.broker_url

    @property
    def uploads_dir(self) -> Path:
        return self.data_dir / "uploads"

    def prepare_folders(self) -> None:
        """The data folder with its parts, readable by the owner alone."""
        for folder in (self.data_dir, self.uploads_dir):
            if not folder.is_dir():
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                sync_folder(folder.parent)
