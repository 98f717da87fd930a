"""How long it takes until all is well again after a fault, as the database and the clients see it."""

import contextlib
import threading
import time
from dataclasses import dataclass, field

import psycopg

from tests.chaos.client import Client
from tests.chaos.installation import Installation

LOOK_S = 0.5
CLAIMED = "SELECT audit_id, loop_id, attempts FROM audit_items WHERE state = 'claimed'"
WRITTEN = "SELECT count(*) FROM verdicts"

Claims = set[tuple[int, int, int]]


@dataclass
class Injected:
    """A fault that was injected: when, who held which loops then, and when it was over; or why it was not done."""

    kind: str
    at: float
    held: Claims
    verdicts: int
    promises: int
    recovered_s: float | None = None
    skipped: str | None = None
    left_out: bool = False


@dataclass
class Watch:
    """Recovered is: every loop claimed at the fault has ended or was claimed anew, a verdict was written since, and an
    upload was acknowledged since."""

    installation: Installation
    client: Client
    faults: list[Injected] = field(default_factory=list)
    verdicts: int = 0
    claims: Claims = field(default_factory=set)
    idle: threading.Event = field(default_factory=threading.Event)
    _stopping: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def begin(self) -> None:
        self._thread = threading.Thread(target=self._look_on, name="watch", daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()

    def note(self, kind: str) -> Injected:
        """To be called at the moment of the fault."""
        with self._lock:
            fault = Injected(kind, time.monotonic(), set(self.claims), self.verdicts, len(self.client.promises))
            self.faults.append(fault)
            return fault

    @property
    def open(self) -> list[Injected]:
        return [fault for fault in self.faults if fault.recovered_s is None and fault.skipped is None]

    def _look_on(self) -> None:
        while not self._stopping.is_set():
            with contextlib.suppress(psycopg.Error), self.installation.connect() as connection:
                while not self._stopping.wait(LOOK_S):
                    self._look(connection)
            self._stopping.wait(LOOK_S)

    def _look(self, connection: psycopg.Connection) -> None:
        claims = {(row[0], row[1], row[2]) for row in connection.execute(CLAIMED)}
        (verdicts,) = connection.execute(WRITTEN).fetchone() or (0,)
        with self._lock:
            self.claims, self.verdicts = claims, verdicts
            for fault in self.open:
                fault.held &= claims
                moved = verdicts > fault.verdicts or self.idle.is_set()
                taken = len(self.client.promises) > fault.promises or self.client.stopping.is_set()
                if not fault.held and moved and taken:
                    fault.recovered_s = time.monotonic() - fault.at
