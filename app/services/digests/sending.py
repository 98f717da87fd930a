"""What is sent to a receiver, and how a receiver is called where others may read it."""

from dataclasses import dataclass, field
from urllib.parse import urlsplit


@dataclass(frozen=True)
class Mail:
    """A digest for a mailbox; `id` is the same at every try, so that a receiver knows what it has already."""

    id: str
    subject: str
    text: str = field(repr=False)
    html: str = field(repr=False)


@dataclass(frozen=True)
class Post:
    """A digest for a webhook; `id` as a mail has it."""

    id: str
    body: bytes = field(repr=False)


class NotSentError(Exception):
    """A receiver did not take it; the text says why, without secrets. `final`: it would not do so later either."""

    def __init__(self, text: str, *, final: bool = False) -> None:
        super().__init__(text)
        self.final = final


def shown(receiver: str) -> str:
    """A receiver for lists and logs: of a webhook only its server, because the rest may be its secret."""
    if receiver.startswith("mailto:"):
        return receiver
    parts = urlsplit(receiver)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2] or '?'}/..."
