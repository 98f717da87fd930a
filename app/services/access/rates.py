"""How many requests a key may make in a minute, and how often an address may try keys that are wrong."""

import logging
import math
import time
from collections.abc import Callable
from ipaddress import IPv6Address, IPv6Network
from typing import TYPE_CHECKING

from limits import RateLimitItem, RateLimitItemPerMinute
from limits.errors import ConfigurationError
from limits.storage import MemoryStorage, RedisStorage, storage_from_string
from limits.strategies import SlidingWindowCounterRateLimiter

from app.queue.refusals import refusal_of
from app.services.access.authentication import Via
from app.services.access.identity import Identity
from app.settings import Settings

if TYPE_CHECKING:
    from limits.storage import Storage

REFUSALS_PER_MINUTE = 20
WITHOUT_STORAGE_S = 5.0

log = logging.getLogger("loopaudit.access")


class Rates:
    """Counts in this process, or in the Redis of `rate_limit_url`, where several processes serve one plant.

    A Redis that is away is not asked for a few seconds; this process counts alone in the meantime.
    """

    def __init__(self, settings: Settings) -> None:
        self._own = SlidingWindowCounterRateLimiter(MemoryStorage())
        self.shared = bool(settings.rate_limit_url)
        self._shared = SlidingWindowCounterRateLimiter(_storage(settings.rate_limit_url)) if self.shared else self._own
        self._away_until_s = 0.0

    def wait_s(self, identity: Identity) -> int:
        """0 where this request is within the key's limit, otherwise the seconds until one is."""
        if not identity.key_id or not identity.requests_per_minute:
            return 0
        return self._hit(RateLimitItemPerMinute(identity.requests_per_minute), f"key-{identity.key_id}")

    def refusal_wait_s(self, address: str, via: Via = "key") -> int:
        """Counts a wrong key from this address, or apart from those a wrong session; 0, or the seconds for which it
        should stay away. May wait for Redis: to be called away from the event loop."""
        return self._hit(RateLimitItemPerMinute(REFUSALS_PER_MINUTE), refusals_of(address, via))

    def refused_s(self, address: str, via: Via = "key") -> int:
        """The same without counting one: 0, or the seconds for which this address should stay away."""
        item, name = RateLimitItemPerMinute(REFUSALS_PER_MINUTE), refusals_of(address, via)
        return self._asked(lambda limiter: limiter.test(item, name), item, name)

    def _hit(self, item: RateLimitItem, name: str) -> int:
        return self._asked(lambda limiter: limiter.hit(item, name), item, name)

    def _asked(self, ask: Callable[[SlidingWindowCounterRateLimiter], bool], item: RateLimitItem, name: str) -> int:
        limiter = self._limiter()
        try:
            if ask(limiter):
                return 0
            return max(1, math.ceil(limiter.get_window_stats(item, name).reset_time - time.time()))
        except _errors(limiter) as error:
            log.warning("the storage of rate limits is away, this process counts alone: %s", type(error).__name__)
            self._away_until_s = time.monotonic() + WITHOUT_STORAGE_S
            return self._asked(ask, item, name)

    def _limiter(self) -> SlidingWindowCounterRateLimiter:
        return self._own if time.monotonic() < self._away_until_s else self._shared


def refusals_of(address: str, via: Via) -> str:
    return f"refused-{counted_as(address)}" if via == "key" else f"refused-{via}-{counted_as(address)}"


def counted_as(address: str) -> str:
    """Whom an address is counted with: one of IPv6 with its network of 64 bit, because whoever has one has them all."""
    try:
        ip = IPv6Address(address.partition("%")[0])
    except ValueError:
        return address
    return str(ip.ipv4_mapped or IPv6Network((ip, 64), strict=False))


def shared_refusal(settings: Settings) -> str | None:
    """Why the Redis of `rate_limit_url` cannot be asked, going on from its name; None where it can. Raises ValueError
    where that is no such address."""
    try:
        storage = _storage(settings.rate_limit_url)
    except ConfigurationError as error:
        raise ValueError("it is no address of a Redis") from error
    return None if storage.check() else _why_not(storage)


def _why_not(storage: "Storage") -> str:
    """What `check` keeps to itself."""
    if isinstance(storage, RedisStorage):
        try:
            storage.get_connection().ping()
        except storage.base_exceptions as error:
            if refusal := refusal_of(error):
                return refusal.told
    return "does not answer"


def _storage(url: str) -> "Storage":
    return storage_from_string(  # type: ignore[return-value]  # asynchronous for other addresses only
        url, socket_timeout=0.5, socket_connect_timeout=0.5, key_prefix="loopaudit-rate"
    )


def _errors(limiter: SlidingWindowCounterRateLimiter) -> tuple[type[Exception], ...]:
    errors = limiter.storage.base_exceptions
    return errors if isinstance(errors, tuple) else (errors,)
