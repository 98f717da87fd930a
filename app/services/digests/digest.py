"""What a digest holds: the worst loops of each unit, and what changed since the run before."""

from dataclasses import dataclass, field

from app.services.digests.doings import Doing, doings
from app.services.moments import PlantClock
from app.services.outward import AuditOut
from app.services.plant.repaired import RepairView
from app.services.plant.work_list import Work
from app.services.results import ChangeView
from app.services.stating.shelving import Shelf
from app.services.telling.naming import one_line
from app.services.telling.wording import brief, probability


@dataclass(frozen=True)
class DigestLoop:
    """A loop to look at; `why` is the weightiest reason, `address` its page (empty: not known how people reach it),
    `judged` of which time its verdict is, where that is not up to its newest samples. `measured`: whether its
    probability is, and not a prior. `shelved` until when it is shelved, and why it is listed all the same.
    `of_before_repair`: whether its verdict is of before a repair that is stated by now. `recorded_to`: its newest
    sample (ISO 8601, UTC), of those that are listed for an old one, `of_old_record`."""

    loop: str
    verdict: str
    reliability: str
    stiction_probability: float | None
    likely_cause: str | None
    health: float | None
    importance: float
    why: str
    address: str
    judged: str = ""
    measured: bool = True
    shelved: str = ""
    of_before_repair: bool = False
    recorded_to: str | None = None
    of_old_record: bool = False

    @property
    def told(self) -> str:
        """What stands behind the verdict."""
        known = self.measured and self.stiction_probability is not None
        return f"{f'probability {probability(self.stiction_probability)}, ' if known else ''}{brief(vars(self))}"


@dataclass(frozen=True)
class Area:
    unit: str | None
    loops: list[DigestLoop]


@dataclass(frozen=True)
class Unlisted:
    """How many more valves stick, to be relied on (`reliable`) or not (`unsure`), and in how many more loops PV does
    not answer OP."""

    reliable: int = 0
    unsure: int = 0
    unanswered: int = 0

    @property
    def sticking(self) -> int:
        return self.reliable + self.unsure

    @property
    def words(self) -> str:
        """Empty where every loop is listed."""
        counted = (
            (self.reliable, "valves that stick, reliable verdict"),
            (self.unsure, "valves that stick, look first"),
            (self.unanswered, "loops in which PV does not answer OP"),
        )
        told = ", ".join(f"{what} ({count:,} more)" for count, what in counted if count)
        return f"These weigh most; the table of the plant has all: {told}" if told else ""


@dataclass(frozen=True)
class Changed:
    """listed: what changed, told loop by loop; new_besides: those that are newly said to stick and stand not there;
    others: how many verdicts changed otherwise and stand not there."""

    listed: list[ChangeView]
    new_besides: list[str]
    others: int

    @property
    def more(self) -> bool:
        return bool(self.new_besides or self.others)

    @property
    def new(self) -> set[str]:
        """Tags of loops that are newly said to stick."""
        return {change.loop for change in self.listed if change.kind == "new"} | set(self.new_besides)


NOTHING_CHANGED = Changed([], [], 0)


@dataclass(frozen=True)
class Digest:
    """What one run came to; the same whenever it is asked for, but for loops that were retired since and, as long as it
    is the newest run, for notes that were written since: orders, repairs and shelvings. `refused`: how many loops were
    not auditable, by likely cause; `refused_loops`: the most important of each. `to_manual`: loops that went to manual,
    and what is still said of them. `old`: the worst of those without a newer sample, `why_old` what that is, and why
    they stand apart. `work`: what to do first in the plant. `shelf`: the loops that are shelved, of an older run those
    that were when it ended, which `work`, `areas`, `old` and `refused_loops` leave out. `reliable`: how many of the
    valves that stick can be relied on. `unlisted`: how many loops there is something to do about that `work` has no
    room for. `retired`: how many of the run's loops are retired and left out."""

    plant: str
    run: AuditOut
    verdicts: dict[str, int]
    refused: dict[str, int]
    refused_loops: dict[str, list[str]]
    arrivals: list[str]
    work: list[Work]
    areas: list[Area]
    old: list[DigestLoop]
    changed: Changed
    to_manual: list[str]
    repairs: list[RepairView]
    more_repairs: bool
    shelf: Shelf
    compared: bool
    public_url: str
    clock: PlantClock
    retired: int = 0
    reliable: int = 0
    why_old: str = ""
    unlisted: Unlisted = field(default_factory=lambda: Unlisted())

    @property
    def doings(self) -> list[Doing]:
        return doings(self.work, self.new)

    def more_of(self, doing: Doing) -> str:
        """Which step is wanted is known of those that are listed alone."""
        left = self.unlisted.sticking if doing.verdict == "stiction" else self.unlisted.unanswered
        return f"and {'at least ' if left else ''}{doing.more:,} more"

    @property
    def changes(self) -> list[ChangeView]:
        return self.changed.listed

    @property
    def new_besides(self) -> list[str]:
        return self.changed.new_besides

    @property
    def other_changes(self) -> int:
        return self.changed.others

    @property
    def new(self) -> set[str]:
        """Tags of loops that are newly said to stick."""
        return self.changed.new

    @property
    def others(self) -> list[Area]:
        """The worst of each unit that no step is listed for."""
        named = {one.loop for one in self.work}
        left = [Area(area.unit, [one for one in area.loops if one.loop not in named]) for area in self.areas]
        return [area for area in left if area.loops]

    @property
    def besides(self) -> str:
        """Of what changed, what is not told loop by loop."""
        told = (
            [f"newly said to stick as well: {', '.join(map(one_line, self.new_besides))}"] if self.new_besides else []
        )
        told += [f"and {self.other_changes:,} more that changed in another way"] if self.other_changes else []
        return "; ".join(told)

    def recorded(self, loop: DigestLoop) -> str:
        """ "newest sample 2026-01-31 04:00", for the list of old records."""
        return f"newest sample {self.clock.recorded(loop.recorded_to)}" if loop.recorded_to else ""
