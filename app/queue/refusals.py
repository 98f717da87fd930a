"""A broker that answers and refuses: what is wrong, by a stable code and in words.

Errors are told apart by the names of their classes: a worker on the folder loads no client of Redis or RabbitMQ.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class BrokerRefusal:
    """`state` is a word for the place where other brokers are `ok` or `away`; `what` goes on from "the broker"."""

    code: str
    state: str
    what: str
    advice: str

    @property
    def told(self) -> str:
        """What goes on from "the broker" in a log, which tells it from one that is away."""
        return f"answers and {self.what}"


LOGIN = BrokerRefusal(
    code="broker_login",
    state="login refused",
    what="refuses the login",
    advice="correct user, password, rights or virtual host in LOOPAUDIT_BROKER_URL, or give the user what it lacks",
)
READ_ONLY = BrokerRefusal(
    code="broker_read_only",
    state="read-only",
    what="is a read-only replica",
    advice="name the Redis that takes writes in LOOPAUDIT_BROKER_URL, or make this one take them",
)
FULL = BrokerRefusal(
    code="broker_refused",
    state="full",
    what="takes nothing, make room in it",
    advice="make room in its memory (maxmemory) or on its disk",
)
OTHER = BrokerRefusal(
    code="broker_refused",
    state="refuses",
    what="refuses",
    advice="look at what it says, and at its log",
)
BY_CLASS = {
    **dict.fromkeys(("AuthenticationError", "AuthorizationError", "NoPermissionError"), LOGIN),  # of Redis
    **dict.fromkeys(("AccessRefused", "NotAllowed"), LOGIN),  # of RabbitMQ; the second of a virtual host
    "AuthenticationWrongNumberOfArgsError": LOGIN,
    "ReadOnlyError": READ_ONLY,
    "OutOfMemoryError": FULL,
}
DISK_FULL = "MISCONF"
"""So begins what a Redis says that cannot write what it keeps."""
RETRIES_IN_S = 30.0
"""The longest pause between two tries."""


def refusal_of(error: BaseException, such: tuple[type[Exception], ...] = ()) -> BrokerRefusal | None:
    """What the broker refused, where the error or what led to it tells that; None: it is away, or the fault is ours.
    such: classes of errors with which a broker refuses for whatever other reason; kombu wraps those too."""
    for it in _led_to(error):
        if known := BY_CLASS.get(type(it).__name__):
            return known
        if DISK_FULL in str(it):
            return FULL
    return OTHER if isinstance(error, such) or isinstance(error.__cause__, such) else None


def tell_failure(log: logging.Logger, error: Exception, pause_s: float, such: tuple[type[Exception], ...] = ()) -> None:
    """Why there is no connection to the broker, and when the next one is tried."""
    refusal = refusal_of(error, such)
    if refusal is None:
        log.error("the broker is away; trying again in %.0f s: %s", pause_s, error)
    else:
        text = "the broker %s; trying again in %.0f s: %s"
        log.error(text, refusal.told, pause_s, error, extra={"code": refusal.code})


def _led_to(error: BaseException | None) -> Iterator[BaseException]:
    """The error and its causes, as kombu and Celery wrap them."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__
