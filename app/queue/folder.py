"""Celery's messages as files in a folder: a broker that needs no server.

kombu's own file transport loses its worker to a half-written or empty file, moves messages through the system's
temporary folder and writes the table of queues in place. Here a message appears whole or not at all, a file that cannot
be read is dropped, and everything stays in one folder that only its owner can enter.
"""

import fcntl
import logging
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty
from typing import Any

from kombu.transport import filesystem
from kombu.utils.json import dumps, loads

from app.queue.jobs import MOST_WAITING
from app.queue.turns import QueuesOneByOne

LEFT_AFTER_S = 3600.0
"""What was taken, or is being written, for longer than this is nobody's any more: both take milliseconds."""
WAITING, TAKEN, QUEUES = "waiting", "taken", "queues"
DRAFT = "."
WERE_THERE: set[Path] = set()
"""Folders of messages that this process has used."""

log = logging.getLogger("loopaudit.queue")


class Channel(filesystem.Channel):
    """One folder with `waiting` (a file a message), `taken` (those that are being read) and `queues` (which queue hears
    which exchange)."""

    _told = False

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        for part in (WAITING, TAKEN, QUEUES):
            _sweep(self._folder(part))

    def _reset_cycle(self) -> None:
        self._cycle = QueuesOneByOne(self._get_and_deliver, self._active_queues, Empty)

    def _put(self, queue: str, payload: Any, **options: Any) -> None:  # type: ignore[override]  # as kombu's own do
        waiting = self._folder(WAITING)
        if self._size(queue) >= MOST_WAITING:
            return
        name = f"{time.time_ns():020d}_{uuid.uuid4().hex}.{queue}.msg"
        _write_whole(waiting / name, dumps(payload))

    def _get(self, queue: str) -> Any:  # type: ignore[override]  # as above
        try:
            payload = self._take(queue)
        except OSError as error:  # the folder is away, or its disk read-only: a worker that is told so ends
            self._tell(error)
            raise Empty from error
        self._told = False
        if payload is None:
            raise Empty
        return payload

    def _tell(self, error: OSError) -> None:
        if not self._told:
            log.error("the folder of messages cannot be used, it is waited for: %s", error)
            self._told = True

    def _take(self, queue: str) -> Any:
        """The first message that nobody else took; None: there is none."""
        taken = self._folder(TAKEN)
        for path in self._waiting(queue):
            mine = taken / f"{os.getpid()}_{path.name}"
            try:
                path.rename(mine)
            except FileNotFoundError:
                continue  # another worker was quicker
            payload = _read_once(mine)
            if payload is not None:
                return payload
        return None

    def _size(self, queue: str) -> int:
        return len(self._waiting(queue))

    def _purge(self, queue: str) -> int:
        found = self._waiting(queue)
        for path in found:
            path.unlink(missing_ok=True)
        return len(found)

    def get_table(self, exchange: str) -> list[filesystem.exchange_queue_t]:
        try:
            found = loads(self._table(exchange).read_text(encoding="utf-8"))
        except (FileNotFoundError, ValueError):
            return []
        return [filesystem.exchange_queue_t(*row) for row in found]

    def _queue_bind(self, exchange: str, routing_key: str, pattern: str, queue: str) -> None:
        row = filesystem.exchange_queue_t(routing_key or "", pattern or "", queue or "")
        with self._one_at_a_time():
            rows = self.get_table(exchange)
            if row not in rows:
                _write_whole(self._table(exchange), dumps([row, *rows]))

    def _waiting(self, queue: str) -> list[Path]:
        ending = f".{queue}.msg"
        folder = self._folder(WAITING)
        return [folder / name for name in sorted(os.listdir(folder)) if name.endswith(ending)]

    def _table(self, exchange: str) -> Path:
        return self._folder(QUEUES) / self._exchange_file(exchange).name

    @contextmanager
    def _one_at_a_time(self) -> Iterator[None]:
        with (self._folder(QUEUES) / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    def _folder(self, part: str) -> Path:
        whole = Path(self.transport_options["folder"])
        # By itself: the mode is not that of folders above. They are not made anew where they are away, as with a share.
        whole.mkdir(mode=0o700, parents=whole not in WERE_THERE, exist_ok=True)
        WERE_THERE.add(whole)
        folder = whole / part
        folder.mkdir(mode=0o700, exist_ok=True)
        return folder


class Transport(filesystem.Transport):
    """`folder://`, with the transport option `folder`."""

    Channel = Channel
    driver_type = "folder"
    driver_name = "folder"


def _write_whole(path: Path, text: str) -> None:
    """Under its name the file is whole or not there."""
    draft = path.with_name(f"{DRAFT}{path.name}.{uuid.uuid4().hex}")
    try:
        draft.write_text(text, encoding="utf-8")
        draft.rename(path)
    finally:
        with suppress(FileNotFoundError):
            draft.unlink()


def _sweep(folder: Path) -> None:
    """Removes what a process left half done when it was ended. Nobody waits for it: the schedule rings again."""
    before = time.time() - LEFT_AFTER_S
    for path in folder.iterdir() if folder.name == TAKEN else folder.glob(f"{DRAFT}*"):
        with suppress(FileNotFoundError):
            if path.stat().st_ctime < before:
                path.unlink()


def _read_once(path: Path) -> Any:
    """What the file says; None where that is no message. The file is gone then, whatever it holds."""
    try:
        payload = loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError, OSError):  # of which the first is also what cannot be decoded
        return None
    finally:
        path.unlink(missing_ok=True)
    return payload if isinstance(payload, dict) and "body" in payload and "properties" in payload else None
