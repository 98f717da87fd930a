"""Those who use the service meanwhile: they send exports and start audits, and remember what was promised to them."""

import hashlib
import threading
import time
from collections import Counter
from dataclasses import dataclass, field

import httpx
import numpy as np

from app.engine.recording import FloatArray
from app.lab.bench.loops import records

GROUP = 20
FIRST_MINUTE_S = 1_767_225_600
PAUSE_S = 0.5


@dataclass(frozen=True)
class Export:
    """What is sent, and what of it must be found later."""

    name: str
    content: bytes
    loops: tuple[str, ...]
    rows: int

    @property
    def fingerprint(self) -> str:
        return hashlib.sha256(self.content).hexdigest()


@dataclass(frozen=True)
class Promise:
    """An upload that was acknowledged."""

    upload_id: int
    export: Export
    at: float


@dataclass
class Plant:
    """Simulated loops, each long enough for a first export and what comes afterwards, minute by minute."""

    count: int
    first_rows: int
    more_rows: int
    most: int
    tags: list[str] = field(default_factory=list)
    signals: list[tuple[FloatArray, FloatArray, FloatArray]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for loop in records(self.count, self.first_rows + self.most * self.more_rows):
            self.tags.append(loop.tag)
            self.signals.append((loop.pv, loop.op, loop.sp))

    @property
    def groups(self) -> int:
        return -(-self.count // GROUP)

    def export(self, group: int, number: int) -> Export:
        """The export `number` of a group of loops; 0 is the first and longest."""
        start = 0 if number == 0 else self.first_rows + (number - 1) * self.more_rows
        stop = self.first_rows + number * self.more_rows
        chosen = range(group * GROUP, min((group + 1) * GROUP, self.count))
        tags = tuple(self.tags[index] for index in chosen)
        head = "time," + ",".join(f"{tag}.PV,{tag}.OP,{tag}.SP" for tag in tags)
        times = FIRST_MINUTE_S + 60 * np.arange(start, stop)
        columns = np.column_stack([signal[start:stop] for index in chosen for signal in self.signals[index]])
        lines = [f"{t}," + ",".join(f"{value:.4f}" for value in row) for t, row in zip(times, columns, strict=True)]
        return Export(f"group-{group}-{number}.csv", "\n".join([head, *lines]).encode(), tags, stop - start)


def bad_loops(tags: tuple[str, ...], rows: int = 300) -> Export:
    """One export of loops that swing a little: what spoils them is their name."""
    steps = np.arange(rows)
    pv, op = 20 + 2 * np.sin(steps / 6 - 0.8) + 0.1 * np.cos(steps * 1.9), 50 + 5 * np.sin(steps / 6)
    lines = [f"{FIRST_MINUTE_S + 60 * i}," + ",".join([f"{pv[i]:.3f},{op[i]:.3f}"] * len(tags)) for i in steps]
    head = "time," + ",".join(f"{tag}.PV,{tag}.OP" for tag in tags)
    return Export("bad.csv", "\n".join([head, *lines]).encode(), tags, rows)


@dataclass
class Client:
    """Sends until it is acknowledged, however often that takes; keeps what was promised, and how many loops of each run
    were asked for."""

    url: str
    plant: Plant
    promises: list[Promise] = field(default_factory=list)
    runs: dict[int, float] = field(default_factory=dict)
    asked: dict[int, int] = field(default_factory=dict)
    answers: Counter[str] = field(default_factory=Counter)
    again: list[Export] = field(default_factory=list)
    stopping: threading.Event = field(default_factory=threading.Event)
    enough: threading.Event = field(default_factory=threading.Event)
    threads: list[threading.Thread] = field(default_factory=list)

    def http(self) -> httpx.Client:
        return httpx.Client(base_url=self.url, timeout=20)

    def send(self, http: httpx.Client, export: Export) -> bool:
        """One try; whether it was acknowledged."""
        try:
            answer = http.post("/v1/uploads", params={"filename": export.name}, content=export.content)
        except httpx.HTTPError as error:
            self.answers[type(error).__name__] += 1
            return False
        self.answers[f"upload {answer.status_code}"] += 1
        if answer.status_code != 202:
            return False
        self.promises.append(Promise(int(answer.json()["id"]), export, time.monotonic()))
        return True

    def send_until_taken(self, http: httpx.Client, export: Export) -> None:
        while not self.send(http, export):
            if self.stopping.wait(PAUSE_S):
                self.again.append(export)  # still unpromised; sent once more at the end
                return

    def start_run(self, http: httpx.Client, tags: list[str]) -> int | None:
        """The run's number; None where no answer came, whether or not it was started."""
        try:
            answer = http.post("/v1/audits", json={"tags": tags})
        except httpx.HTTPError as error:
            self.answers[type(error).__name__] += 1
            return None
        self.answers[f"audit {answer.status_code}"] += 1
        if answer.status_code != 202:
            return None
        number = int(answer.json()["id"])
        self.runs[number], self.asked[number] = time.monotonic(), len(tags)
        return number

    def left(self, http: httpx.Client, run: int) -> int:
        """Loops that the run still has to do; all that there could be where no answer comes."""
        try:
            answer = http.get(f"/v1/audits/{run}")
        except httpx.HTTPError as error:
            self.answers[type(error).__name__] += 1
            return len(self.plant.tags)
        self.answers[f"progress {answer.status_code}"] += 1
        return int(answer.json()["open"]) if answer.status_code == 200 else len(self.plant.tags)

    def fill(self) -> None:
        """The first export of every group, one after the other."""
        with self.http() as http:
            for group in range(self.plant.groups):
                self.send_until_taken(http, self.plant.export(group, 0))

    def begin(self, uploads_every_s: float) -> None:
        for work in (lambda: self._keep_sending(uploads_every_s), self._keep_auditing):
            thread = threading.Thread(target=work, daemon=True)
            thread.start()
            self.threads.append(thread)

    def end(self) -> None:
        self.stopping.set()
        for thread in self.threads:
            thread.join()

    def send_the_rest(self) -> None:
        """What nobody acknowledged so far, now that all is well."""
        with self.http() as http:
            for export in self.again:
                deadline = time.monotonic() + 60
                while not self.send(http, export) and time.monotonic() < deadline:
                    time.sleep(PAUSE_S)

    def _keep_sending(self, every_s: float) -> None:
        with self.http() as http:
            for turn in range(self.plant.groups * self.plant.most):
                if self.stopping.wait(every_s):
                    return
                export = self.plant.export(turn % self.plant.groups, 1 + turn // self.plant.groups)
                self.send_until_taken(http, export)

    def _keep_auditing(self) -> None:
        """A run over the plant, and the next one as soon as little is left of it."""
        with self.http() as http:
            run: int | None = None
            while not self.stopping.wait(PAUSE_S):
                if self.enough.is_set():
                    return
                if run is None or self.left(http, run) < len(self.plant.tags) / 10:
                    run = self.start_run(http, self.plant.tags)
